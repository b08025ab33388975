//! The planes of surfels, for depth and normals.

use glam::{DVec2, DVec3};

use super::project::{Footprint, View};
use crate::render::EDGE_ON;

/// Variance in px² that keeps the slope of an edge-on surfel's plane finite.
const SLOPE_FLOOR: f64 = 1e-4;

/// The plane of a surfel as the screen sees it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surface {
    /// Depth of the centre.
    pub depth: f32,
    /// Change of the plane's depth, one pixel right, and one down.
    pub slope: [f32; 2],
    /// The plane's depth is held within this distance of the centre's: the Gaussian's own extent in depth.
    pub reach: f32,
    /// World-space normal, turned to the camera.
    pub normal: [f32; 3],
}

impl Surface {
    /// How far the plane is behind the centre, held within the reach.
    #[inline(always)]
    pub fn offset(&self, plane: f32) -> f32 {
        let held = if plane < self.reach { plane } else { self.reach };
        if held > -self.reach { held } else { -self.reach }
    }
}

/// The flat ellipse on the screen and in depth, in f64.
pub(crate) struct Plane {
    /// Its screen covariance Σ'xx, Σ'xy, Σ'yy, with [`SLOPE_FLOOR`].
    pub flat: [f64; 3],
    /// Change of depth with the pixel, zero where that is not finite.
    pub slope: DVec2,
    /// Variance of the whole Gaussian in depth.
    pub depth_variance: f64,
}

/// The plane of the two longer axes. Taking the smallest variance away leaves a flat ellipse (or, for a needle, a
/// line; for a ball, a point) whose depth is a linear function of the pixel: the regression of z on the screen
/// position, slope = Σ'⁻¹ Σ_k (s_k² − s_min²) t_k m_kz.
#[inline(always)]
pub(crate) fn plane(footprint: &Footprint) -> Plane {
    let v = footprint.variances;
    let least = v[0].min(v[1]).min(v[2]);
    let [mut xx, mut xy, mut yy] = [SLOPE_FLOOR, 0.0, SLOPE_FLOOR];
    let mut along = DVec2::ZERO;
    let mut depth_variance = 0.0;
    for k in 0..3 {
        let (t, m) = (footprint.spread[k], footprint.axes[k]);
        let flat = v[k] - least;
        xx += flat * t.x * t.x;
        xy += flat * t.x * t.y;
        yy += flat * t.y * t.y;
        along += t * (flat * m.z);
        depth_variance += v[k] * m.z * m.z;
    }
    let determinant = xx * yy - xy * xy;
    let slope = DVec2::new(yy * along.x - xy * along.y, xx * along.y - xy * along.x) / determinant;
    let finite = slope.x.abs() + slope.y.abs() < f64::INFINITY;
    Plane {
        flat: [xx, xy, yy],
        slope: if finite { slope } else { DVec2::ZERO },
        depth_variance,
    }
}

/// Which axis is the surfel's normal, and that axis in camera space, turned to the camera.
#[inline(always)]
pub(crate) fn outward(view: &View, footprint: &Footprint, log_scale: DVec3) -> (usize, DVec3) {
    // The last among equals, so that isotropic Gaussians take the third axis.
    let (mut axis, mut normal, mut least) = (2, footprint.axes[2], log_scale.z);
    for (k, log_scale) in [(1, log_scale.y), (0, log_scale.x)] {
        let thinner = log_scale < least;
        axis = if thinner { k } else { axis };
        least = if thinner { log_scale } else { least };
        normal = if thinner { footprint.axes[k] } else { normal };
    }
    let sight = if view.is_pinhole() { footprint.point } else { DVec3::Z };
    let away = normal.dot(sight) > EDGE_ON * sight.length();
    (axis, if away { -normal } else { normal })
}
