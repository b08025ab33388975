//! A scene: Gaussians as structure of arrays, and the camera under which it shows its painting.

use glam::{Quat, Vec3};

use crate::{Bounds, Camera, sh};

/// 3D Gaussians in the parametrisation of 3DGS.
///
/// All vectors have the same length, one entry a Gaussian. World: x right, y up, z towards the viewer.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Scene {
    /// Centres, world units.
    pub centers: Vec<Vec3>,
    /// Natural logarithms of the three standard deviations, world units.
    pub log_scales: Vec<Vec3>,
    /// Unit quaternions that turn the Gaussian's own axes into the world's. For surfels the third own axis,
    /// the thinnest, is the outward normal.
    pub rotations: Vec<Quat>,
    /// Logits of the opacities.
    pub opacity_logits: Vec<f32>,
    /// SH coefficients of degree 0 (`f_dc`): sRGB-encoded colour is `0.5 + 0.28209479 · f_dc`.
    pub sh_dc: Vec<[f32; 3]>,
    /// Higher SH coefficients, channel-major as in 3DGS PLY (`f_rest`): `3 · ((degree + 1)² − 1)` a Gaussian, flat.
    pub sh_rest: Vec<f32>,
    /// SH degree of `sh_rest`, 0 to 3.
    pub sh_degree: u8,
    /// The camera under which the scene shows the painting.
    pub canonical_camera: Option<Camera>,
}

/// Why a scene cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SceneError {
    /// A vector is shorter or longer than the others.
    #[error("scene has {centers} centres but {found} {attribute}; every attribute needs one entry a Gaussian")]
    Ragged {
        /// The attribute at fault.
        attribute: &'static str,
        /// Number of centres.
        centers: usize,
        /// Entries found.
        found: usize,
    },
    /// The SH degree is not one that 3DGS defines.
    #[error("SH degree is {0}; expected 0 to 3")]
    ShDegree(u8),
}

/// One Gaussian, for building scenes one at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Centre, world units.
    pub center: Vec3,
    /// Three standard deviations, world units.
    pub scales: Vec3,
    /// Own axes to world.
    pub rotation: Quat,
    /// Opacity in (0, 1); held within ±16 as a logit.
    pub opacity: f32,
    /// sRGB-encoded colour.
    pub color: [f32; 3],
}

impl Scene {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// True when there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// Adds a Gaussian without higher SH coefficients (they are zero when the scene has some).
    pub fn push(&mut self, gaussian: Gaussian) {
        self.centers.push(gaussian.center);
        self.log_scales.push(Vec3::from(gaussian.scales.to_array().map(ln)));
        self.rotations.push(gaussian.rotation);
        self.opacity_logits.push(logit(gaussian.opacity));
        self.sh_dc.push(gaussian.color.map(sh::dc_from_color));
        let rest = self.sh_rest.len() + self.sh_rest_stride();
        self.sh_rest.resize(rest, 0.0);
    }

    /// Number of `sh_rest` entries a Gaussian has.
    pub fn sh_rest_stride(&self) -> usize {
        sh::rest_count(self.sh_degree)
    }

    /// The `sh_rest` entries of Gaussian `i`.
    pub fn sh_rest_of(&self, i: usize) -> &[f32] {
        let stride = self.sh_rest_stride();
        &self.sh_rest[i * stride..(i + 1) * stride]
    }

    /// Standard deviations of Gaussian `i`, world units.
    pub fn scales(&self, i: usize) -> Vec3 {
        let exp = |x: f32| libm::exp(f64::from(x)) as f32;
        Vec3::from(self.log_scales[i].to_array().map(exp))
    }

    /// Opacity of Gaussian `i`, in [0, 1].
    pub fn opacity(&self, i: usize) -> f32 {
        sigmoid(f64::from(self.opacity_logits[i])) as f32
    }

    /// View-independent sRGB-encoded colour of Gaussian `i`; may leave [0, 1].
    pub fn color(&self, i: usize) -> [f32; 3] {
        self.sh_dc[i].map(sh::color_from_dc)
    }

    /// World direction of the thinnest own axis of Gaussian `i` (the third one among equals), a unit vector.
    pub fn normal(&self, i: usize) -> Vec3 {
        let q = self.rotations[i].normalize();
        q * [Vec3::X, Vec3::Y, Vec3::Z][thinnest_axis(self.log_scales[i])]
    }

    /// Checks that all attributes have one entry a Gaussian.
    pub fn validate(&self) -> Result<(), SceneError> {
        if self.sh_degree > sh::MAX_DEGREE {
            return Err(SceneError::ShDegree(self.sh_degree));
        }
        let centers = self.len();
        let counts = [
            ("scales", self.log_scales.len(), centers),
            ("rotations", self.rotations.len(), centers),
            ("opacities", self.opacity_logits.len(), centers),
            ("colours", self.sh_dc.len(), centers),
            (
                "higher SH coefficients",
                self.sh_rest.len(),
                centers * self.sh_rest_stride(),
            ),
        ];
        match counts.into_iter().find(|(_, found, expected)| found != expected) {
            None => Ok(()),
            Some((attribute, found, _)) => Err(SceneError::Ragged {
                attribute,
                centers,
                found,
            }),
        }
    }

    /// True when every number of Gaussian `i` is finite and its quaternion has a direction.
    pub fn is_valid(&self, i: usize) -> bool {
        let q = self.rotations[i];
        self.centers[i].is_finite()
            && self.log_scales[i].is_finite()
            && self.opacity_logits[i].is_finite()
            && q.is_finite()
            && q.length_squared() > 1e-20
            && self.sh_dc[i].iter().all(|x| x.is_finite())
            && self.sh_rest_of(i).iter().all(|x| x.is_finite())
    }

    /// Number of Gaussians that [`Scene::is_valid`] refuses.
    pub fn count_invalid(&self) -> usize {
        (0..self.len()).filter(|&i| !self.is_valid(i)).count()
    }

    /// The Gaussians for which `keep` holds, in order.
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> Scene {
        let kept: Vec<usize> = (0..self.len()).filter(|&i| keep(i)).collect();
        Scene {
            centers: kept.iter().map(|&i| self.centers[i]).collect(),
            log_scales: kept.iter().map(|&i| self.log_scales[i]).collect(),
            rotations: kept.iter().map(|&i| self.rotations[i]).collect(),
            opacity_logits: kept.iter().map(|&i| self.opacity_logits[i]).collect(),
            sh_dc: kept.iter().map(|&i| self.sh_dc[i]).collect(),
            sh_rest: kept.iter().flat_map(|&i| self.sh_rest_of(i)).copied().collect(),
            sh_degree: self.sh_degree,
            canonical_camera: self.canonical_camera,
        }
    }

    /// The scene without invalid Gaussians, and how many were dropped.
    pub fn without_invalid(&self) -> (Scene, usize) {
        let kept = self.filtered(|i| self.is_valid(i));
        let dropped = self.len() - kept.len();
        (kept, dropped)
    }

    /// The least SH degree that holds the coefficients: bands above are zero in every Gaussian.
    pub fn least_sh_degree(&self) -> u8 {
        let bands = sh::bands(self.sh_degree);
        let used = |k: usize| self.sh_rest.iter().skip(k).step_by(bands).any(|&x| x != 0.0);
        let needed = (0..bands).rev().find(|&k| used(k)).map_or(0, |k| k + 1);
        let degree = (0..self.sh_degree).find(|&degree| sh::bands(degree) >= needed);
        degree.unwrap_or(self.sh_degree)
    }

    /// The scene with its [least SH degree](Scene::least_sh_degree). Its pictures are the same, to the bit; many programs
    /// write 45 zeros a Gaussian.
    pub fn with_least_sh_degree(mut self) -> Scene {
        let degree = self.least_sh_degree();
        if degree < self.sh_degree {
            let (bands, kept) = (sh::bands(self.sh_degree), sh::bands(degree));
            let channels = self.sh_rest.chunks_exact(bands);
            self.sh_rest = channels.flat_map(|channel| &channel[..kept]).copied().collect();
            self.sh_degree = degree;
        }
        self
    }

    /// The scene turned by half a turn about the x axis: y and z change their signs. Scenes made from photographs usually
    /// have y downwards; turned over they stand upright here.
    pub fn turned_over(&self) -> Scene {
        let mut scene = self.clone();
        scene.centers.iter_mut().for_each(|c| *c *= Vec3::new(1.0, -1.0, -1.0));
        for q in &mut scene.rotations {
            // (1, 0, 0, 0) · q, by components, so that its length stays as it is to the bit.
            *q = Quat::from_xyzw(q.w, -q.z, q.y, -q.x);
        }
        let bands = sh::bands(self.sh_degree);
        if bands > 0 {
            for channel in scene.sh_rest.chunks_exact_mut(bands) {
                channel.iter_mut().zip(sh::TURNED_OVER).for_each(|(c, sign)| *c *= sign);
            }
        }
        scene.canonical_camera = self.canonical_camera.map(|camera| camera.turned_over());
        scene
    }

    /// The box of the middle of the centres of the valid Gaussians that can be seen at all: along each axis, `share` of
    /// them lie below it and as many above. `None` when there is none.
    pub fn middle_bounds(&self, share: f64) -> Option<Bounds> {
        let visible = logit(1.0 / 255.0);
        let seen: Vec<usize> = (0..self.len())
            .filter(|&i| self.is_valid(i) && self.opacity_logits[i] >= visible)
            .collect();
        let aside = (share.clamp(0.0, 0.5) * seen.len().checked_sub(1)? as f64) as usize;
        let (mut min, mut max) = (Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            let mut along: Vec<f32> = seen.iter().map(|&i| self.centers[i][axis]).collect();
            along.sort_unstable_by(f32::total_cmp);
            (min[axis], max[axis]) = (along[aside], along[along.len() - 1 - aside]);
        }
        Some(Bounds { min, max })
    }

    /// The box of the centres of the valid Gaussians that can be seen at all (opacity ≥ 1/255); `None` when there
    /// is none.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds_of(|i| Some((self.centers[i], Vec3::ZERO)))
    }

    /// As [`Scene::bounds`], with every Gaussian's box of `sigmas` standard deviations.
    pub fn bounds_with_extent(&self, sigmas: f32) -> Option<Bounds> {
        self.bounds_of(|i| {
            let axes = glam::Mat3::from_quat(self.rotations[i].normalize());
            let scales = self.scales(i);
            let squares =
                [axes.x_axis * scales.x, axes.y_axis * scales.y, axes.z_axis * scales.z].map(|axis| axis * axis);
            let half = squares[0] + squares[1] + squares[2];
            let half = Vec3::new(half.x.sqrt(), half.y.sqrt(), half.z.sqrt()) * sigmas;
            half.is_finite().then_some((self.centers[i], half))
        })
    }

    fn bounds_of(&self, extent: impl Fn(usize) -> Option<(Vec3, Vec3)>) -> Option<Bounds> {
        let visible = logit(1.0 / 255.0);
        (0..self.len())
            .filter(|&i| self.is_valid(i) && self.opacity_logits[i] >= visible)
            .filter_map(extent)
            .map(|(center, half)| Bounds {
                min: center - half,
                max: center + half,
            })
            .reduce(|a, b| a.union(&b))
    }

    /// The canonical camera, or a front camera that frames the scene in a square of 768 pixels where it has none.
    pub fn camera_or_default(&self) -> Camera {
        self.canonical_camera.unwrap_or_else(|| {
            let side = 768;
            let mut camera = Camera::front(side, side);
            if let Some(bounds) = self.bounds_with_extent(3.0) {
                let extent = bounds.longest_side().max(1e-6);
                let center = bounds.center();
                camera.projection = crate::Projection::Orthographic {
                    pixels_per_unit: side as f32 / extent,
                };
                camera.translation = Vec3::Z * (2.0 * extent) - camera.rotation * center;
            }
            camera
        })
    }
}

/// Index of the smallest of three; the last among equals, so that isotropic Gaussians take the third axis.
pub(crate) fn thinnest_axis(scales: Vec3) -> usize {
    let [x, y, z] = scales.to_array();
    if z <= x && z <= y {
        2
    } else if y <= x {
        1
    } else {
        0
    }
}

/// The logistic function, in f64 so that opacities near 1 keep their distance from it.
pub fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x))
}

/// The inverse of [`sigmoid`], held within ±16: opacities 0 and 1 stay finite.
pub fn logit(opacity: f32) -> f32 {
    let p = f64::from(opacity);
    (libm::log(p / (1.0 - p)) as f32).clamp(-16.0, 16.0)
}

pub(crate) fn ln(x: f32) -> f32 {
    libm::log(f64::from(x.max(f32::MIN_POSITIVE))) as f32
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn one(center: Vec3) -> Gaussian {
        Gaussian {
            center,
            scales: Vec3::new(0.2, 0.1, 0.01),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
            color: [0.2, 0.4, 0.8],
        }
    }

    #[test]
    fn what_is_pushed_is_what_is_read() {
        let mut scene = Scene {
            sh_degree: 2,
            ..Scene::default()
        };
        scene.push(one(Vec3::X));
        scene.validate().unwrap();
        assert!((scene.opacity(0) - 0.9).abs() < 1e-6);
        assert!((scene.scales(0) - Vec3::new(0.2, 0.1, 0.01)).length() < 1e-6);
        assert!(
            scene
                .color(0)
                .iter()
                .zip([0.2, 0.4, 0.8])
                .all(|(a, b)| (a - b).abs() < 1e-6)
        );
        assert_eq!(scene.normal(0), Vec3::Z);
        assert_eq!(scene.sh_rest.len(), 24);
    }

    #[test]
    fn a_ragged_scene_is_refused_by_name() {
        let mut scene = Scene::default();
        scene.push(one(Vec3::X));
        scene.opacity_logits.clear();
        assert!(scene.validate().unwrap_err().to_string().contains("opacities"));
    }

    #[test]
    fn invalid_gaussians_are_dropped_and_counted_and_do_not_widen_the_bounds() {
        let mut scene = Scene::default();
        for x in [0.0, f32::NAN, 1.0, f32::INFINITY] {
            scene.push(one(Vec3::X * x));
        }
        scene.rotations[2] = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        let (kept, dropped) = scene.without_invalid();
        assert_eq!((kept.len(), dropped, scene.count_invalid()), (1, 3, 3));
        assert_eq!(scene.bounds().unwrap().max, Vec3::ZERO);
        let wide = scene.bounds_with_extent(3.0).unwrap();
        assert!((wide.max - Vec3::new(0.6, 0.3, 0.03)).length() < 1e-5);
    }

    #[test]
    fn a_scene_turned_over_looks_the_same_to_a_camera_turned_with_it() {
        let mut scene = Scene {
            sh_degree: 3,
            canonical_camera: Some(Camera::look_at(
                Vec3::new(0.4, 0.3, 2.0),
                Vec3::ZERO,
                Vec3::Y,
                40,
                30,
                50.0,
            )),
            ..Scene::default()
        };
        scene.push(one(Vec3::new(0.1, -0.2, 0.3)));
        scene.rotations[0] = Quat::from_xyzw(0.5, -0.1, 0.3, 0.8).normalize();
        scene.sh_rest = (0..45).map(|i| (i as f32 - 22.0) / 20.0).collect();
        let turned = scene.turned_over();
        let see = |scene: &Scene| {
            let camera = scene.canonical_camera.unwrap();
            let d = camera.direction_to(scene.centers[0]);
            let basis = sh::basis(3, d);
            let color: f64 = basis
                .iter()
                .zip(scene.sh_rest_of(0))
                .map(|(y, c)| y * f64::from(*c))
                .sum();
            let axes = camera.rotation * glam::Mat3::from_quat(scene.rotations[0]);
            (camera.project(scene.centers[0]).unwrap(), axes, color)
        };
        let ((a, a_axes, a_color), (b, b_axes, b_color)) = (see(&scene), see(&turned));
        assert!((a.pixel[0] - b.pixel[0]).abs() < 1e-4 && (a.pixel[1] - b.pixel[1]).abs() < 1e-4);
        assert!(
            (a.depth - b.depth).abs() < 1e-6 && (a_color - b_color).abs() < 1e-6,
            "{a_color} {b_color}"
        );
        assert!(a_axes.abs_diff_eq(b_axes, 1e-6), "{a_axes} {b_axes}");
        let back = turned.turned_over();
        assert_eq!((back.centers, back.sh_rest), (scene.centers, scene.sh_rest));
    }

    #[test]
    fn the_middle_leaves_strays_aside() {
        let mut scene = Scene::default();
        (0..101).for_each(|i| scene.push(one(Vec3::X * i as f32)));
        scene.centers[100] = Vec3::splat(1e6);
        let middle = scene.middle_bounds(0.01).unwrap();
        assert_eq!((middle.min, middle.max), (Vec3::X, Vec3::X * 99.0));
        assert_eq!(Scene::default().middle_bounds(0.01), None);
    }

    #[test]
    fn the_least_sh_degree_keeps_what_is_not_zero() {
        for used in 0..=3u8 {
            let mut scene = Scene {
                sh_degree: 3,
                ..Scene::default()
            };
            (0..3).for_each(|i| scene.push(one(Vec3::X * i as f32)));
            // The last band of the degree, in green of the second Gaussian.
            if used > 0 {
                scene.sh_rest[45 + 15 + sh::bands(used) - 1] = 0.25;
            }
            let least = scene.clone().with_least_sh_degree();
            least.validate().unwrap();
            assert_eq!(least.sh_degree, used);
            for i in 0..3 {
                let direction = Vec3::new(0.48, -0.6, 0.64);
                let shown = |scene: &Scene| {
                    let basis = sh::basis(scene.sh_degree, direction);
                    let bands = sh::bands(scene.sh_degree).max(1);
                    let channels = scene.sh_rest_of(i).chunks_exact(bands);
                    let sums = channels.map(|c| c.iter().zip(basis).map(|(&c, y)| f64::from(c) * y).sum::<f64>());
                    sums.sum::<f64>()
                };
                assert_eq!(shown(&least), shown(&scene));
            }
            assert_eq!(least.clone().with_least_sh_degree(), least);
        }
        let mut scene = Scene {
            sh_degree: 1,
            ..Scene::default()
        };
        scene.push(one(Vec3::ZERO));
        scene.sh_rest[8] = f32::NAN;
        assert_eq!(
            scene.with_least_sh_degree().sh_degree,
            1,
            "NaN is something to be told of"
        );
    }

    #[test]
    fn opacities_zero_and_one_have_finite_logits() {
        assert_eq!((logit(0.0), logit(1.0)), (-16.0, 16.0));
    }

    #[test]
    fn a_scene_without_a_camera_is_framed_from_the_front() {
        let mut scene = Scene::default();
        scene.push(one(Vec3::new(100.0, 50.0, 7.0)));
        let camera = scene.camera_or_default();
        let seen = camera.project(scene.centers[0]).unwrap();
        assert!((seen.pixel[0] - 383.5).abs() < 0.1 && seen.depth > 0.0);
    }
}
