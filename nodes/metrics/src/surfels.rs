//! A scene as surfels: what the geometric metrics look at.

use gear_splat::Scene;
use glam::{DVec3, Vec3};

/// Oriented area elements, in f64.
#[derive(Clone, Debug, Default)]
pub struct Surfels {
    /// Centres, world units.
    pub centers: Vec<DVec3>,
    /// Unit normals: the axis of the smallest deviation (the third axis when the deviations are equal).
    pub normals: Vec<DVec3>,
    /// Opacity times the product of the two largest deviations: opaque area.
    pub weights: Vec<f64>,
}

impl Surfels {
    /// The surfels of a scene of valid Gaussians (see [`Scene::without_invalid`]).
    pub fn of(scene: &Scene) -> Self {
        let mut surfels = Self::default();
        for i in 0..scene.centers.len() {
            let scales = scene.log_scales[i];
            surfels.centers.push(scene.centers[i].as_dvec3());
            surfels.normals.push(scene.normal(i).as_dvec3());
            let opacity = 1.0 / (1.0 + libm::exp(-f64::from(scene.opacity_logits[i])));
            surfels.weights.push(opacity * area(scales));
        }
        surfels
    }

    /// Total opaque area.
    pub fn total(&self) -> f64 {
        self.weights.iter().fold(0.0, |sum, w| sum + w)
    }
}

/// Product of the two largest deviations: the exponential of the sum of logs less the smallest.
fn area(log_scales: Vec3) -> f64 {
    let s = log_scales.as_dvec3();
    libm::exp(s.x + s.y + s.z - s.min_element())
}
