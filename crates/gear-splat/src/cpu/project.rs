//! Stage 1: every Gaussian becomes an ellipse on the screen (EWA splatting; Zwicker 2001, Kerbl 2023).
//!
//! With camera-space axes m_k and standard deviations s_k, and the projection's Jacobian J, the screen covariance is
//! Σ = Σ_k s_k² t_k t_kᵀ + δ·1, where t_k = J m_k. It is computed in f64: a needle's determinant cancels far more
//! than f32 holds. The determinant before dilation is taken in product form (Cauchy–Binet),
//! det₀ = Σ_{k<l} s_k² s_l² (t_k × t_l)², so that det = det₀ + δ·tr + δ² never cancels.
//!
//! The ellipse is kept as (mean, shear, precision_x, precision_y) with
//! q = precision_x · (x − mx − shear·(y − my))² + precision_y · (y − my)²: along a row only the first square
//! changes, and it is exact in f32 even for diagonal needles, where A·dx² + 2B·dx·dy + C·dy² cancels.

use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

use crate::render::{REACH_SIGMAS, ScreenFilter};
use crate::scene::{sigmoid, thinnest_axis};
use crate::{Camera, Projection, RenderOptions, Scene, sh};

/// Variance in px² that keeps the slope of an edge-on surfel's plane finite.
const SLOPE_FLOOR: f64 = 1e-4;
/// Screen standard deviations are held below this, so that everything stays finite in f32.
const SIGMA_MAX: f64 = 1e30;

/// A Gaussian on the screen, in pixels. `cutoff < 0` marks one that is not seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Splat {
    /// Centre.
    pub mean: [f32; 2],
    /// Σxy / Σyy: how far the centre of a row moves with y.
    pub shear: f32,
    /// 1 / (Σxx − Σxy²/Σyy): the inverse variance along a row.
    pub precision_x: f32,
    /// 1 / Σyy.
    pub precision_y: f32,
    /// 1 / √precision_x.
    pub sigma_x: f32,
    /// Opacity at the centre.
    pub opacity: f32,
    /// The largest q at which α ≥ 1/255: 2 ln(255 · opacity).
    pub cutoff: f32,
}

impl Splat {
    pub const UNSEEN: Self = Self {
        mean: [0.0; 2],
        shear: 0.0,
        precision_x: 0.0,
        precision_y: 0.0,
        sigma_x: 0.0,
        opacity: 0.0,
        cutoff: -1.0,
    };

    pub fn is_seen(&self) -> bool {
        self.cutoff >= 0.0
    }
}

/// The plane of a surfel as the screen sees it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surface {
    /// Depth of the centre.
    pub depth: f32,
    /// Depth gained by a pixel to the right, and one down.
    pub slope: [f32; 2],
    /// The plane's depth is held within this distance of the centre's: the Gaussian's own extent in depth.
    pub reach: f32,
    /// World-space normal, turned to the camera.
    pub normal: [f32; 3],
}

/// The camera in f64, once for all Gaussians.
pub(crate) struct View {
    pub rotation: DMat3,
    translation: DVec3,
    principal: DVec2,
    projection: Projection,
    limit: [f64; 2],
    near: f64,
    pub filter: ScreenFilter,
}

/// One Gaussian seen by a [`View`], with what the chain rule needs again.
pub(crate) struct Footprint {
    /// Centre in camera space.
    pub point: DVec3,
    /// Camera-space unit axes.
    pub axes: DMat3,
    /// Squared standard deviations.
    pub variances: [f64; 3],
    /// Projected axes t_k, pixels a world unit.
    pub spread: [DVec2; 3],
    /// Pixel coordinates of the centre.
    pub mean: DVec2,
    /// Σxx, Σxy, Σyy with the dilation.
    pub covariance: [f64; 3],
    /// det before the dilation, and after.
    pub determinants: [f64; 2],
}

impl View {
    pub fn new(camera: &Camera, options: &RenderOptions) -> Self {
        Self {
            rotation: camera.rotation.as_dmat3(),
            translation: camera.translation.as_dvec3(),
            principal: DVec2::new(f64::from(camera.principal[0]), f64::from(camera.principal[1])),
            projection: camera.projection,
            limit: camera.jacobian_limit().map(f64::from),
            near: f64::from(options.near).max(1e-12),
            filter: options.filter,
        }
    }

    /// Scale s and clamped slopes x/z, y/z of J = [s 0 −s·tx; 0 s −s·ty]. Orthographic: (s, 0, 0).
    pub fn linearised(&self, p: DVec3) -> (f64, [f64; 2]) {
        match self.projection {
            Projection::Orthographic { pixels_per_unit } => (f64::from(pixels_per_unit), [0.0; 2]),
            Projection::Pinhole { focal_px } => {
                let [lx, ly] = self.limit;
                let slopes = [(p.x / p.z).clamp(-lx, lx), (p.y / p.z).clamp(-ly, ly)];
                (f64::from(focal_px) / p.z, slopes)
            }
        }
    }

    /// Whether the slopes of [`View::linearised`] are inside the clamp, so that they still change with the centre.
    pub fn inside_limit(&self, p: DVec3) -> [bool; 2] {
        [(p.x / p.z).abs() <= self.limit[0], (p.y / p.z).abs() <= self.limit[1]]
    }

    pub fn is_pinhole(&self) -> bool {
        matches!(self.projection, Projection::Pinhole { .. })
    }

    pub fn footprint(&self, scene: &Scene, i: usize) -> Option<Footprint> {
        let point = self.rotation * scene.centers[i].as_dvec3() + self.translation;
        if self.is_pinhole() && point.z < self.near {
            return None;
        }
        let (s, slopes) = self.linearised(point);
        let mean = self.principal + point.truncate() * s;
        let axes = self.rotation * rotation_matrix(scene.rotations[i].as_dquat());
        let variances = scene.log_scales[i]
            .to_array()
            .map(|l| libm::exp(2.0 * f64::from(l)).clamp(1e-60, 1e60));
        let spread = [axes.x_axis, axes.y_axis, axes.z_axis]
            .map(|m| DVec2::new(s * (m.x - slopes[0] * m.z), s * (m.y - slopes[1] * m.z)));

        let [mut xx, mut xy, mut yy] = [0.0; 3];
        for (v, t) in variances.iter().zip(&spread) {
            xx += v * t.x * t.x;
            xy += v * t.x * t.y;
            yy += v * t.y * t.y;
        }
        let mut before = 0.0;
        for (k, l) in [(0, 1), (0, 2), (1, 2)] {
            let area = spread[k].perp_dot(spread[l]);
            before += variances[k] * variances[l] * area * area;
        }
        let delta = self.filter.variance();
        Some(Footprint {
            point,
            axes,
            variances,
            spread,
            mean,
            covariance: [xx + delta, xy, yy + delta],
            determinants: [before, before + delta * (xx + yy) + delta * delta],
        })
    }

    /// How much of the opacity the filter leaves.
    pub fn compensation(&self, footprint: &Footprint) -> f64 {
        match self.filter {
            ScreenFilter::Dilate(_) => 1.0,
            ScreenFilter::AntiAlias(_) => {
                let [before, after] = footprint.determinants;
                (before / after).sqrt()
            }
        }
    }

    fn splat(&self, scene: &Scene, i: usize, size: [f64; 2]) -> Option<(Splat, f32)> {
        if !scene.is_valid(i) {
            return None;
        }
        let footprint = self.footprint(scene, i)?;
        let opacity = sigmoid(f64::from(scene.opacity_logits[i])) * self.compensation(&footprint);
        let cutoff = 2.0 * libm::log(255.0 * opacity);
        if cutoff.is_nan() || cutoff < 0.0 {
            return None;
        }
        let [xx, xy, yy] = footprint.covariance;
        let determinant = footprint.determinants[1];
        for (axis, variance) in [(0, xx), (1, yy)] {
            let half = (cutoff * variance).sqrt();
            let outside = footprint.mean[axis] + half < 0.0 || footprint.mean[axis] - half > size[axis] - 1.0;
            if outside {
                return None;
            }
        }
        let splat = Splat {
            mean: [footprint.mean.x as f32, footprint.mean.y as f32],
            shear: (xy / yy) as f32,
            precision_x: (yy / determinant) as f32,
            precision_y: (1.0 / yy) as f32,
            sigma_x: (determinant / yy).sqrt().min(SIGMA_MAX) as f32,
            opacity: opacity as f32,
            cutoff: cutoff as f32,
        };
        let depth = footprint.point.z as f32;
        let finite = splat.mean.iter().all(|m| m.is_finite())
            && splat.shear.is_finite()
            && splat.precision_x.is_finite()
            && splat.precision_y.is_finite()
            && depth.is_finite();
        finite.then_some((splat, depth))
    }

    /// The plane of the two longer axes. Taking the smallest variance away leaves a flat ellipse (or, for a needle, a
    /// line; for a ball, a point) whose depth is a linear function of the pixel: the regression of z on the screen
    /// position, slope = Σ'⁻¹ Σ_k (s_k² − s_min²) t_k m_kz.
    pub fn surface(&self, scene: &Scene, i: usize, camera: &Camera) -> Option<Surface> {
        let footprint = self.footprint(scene, i)?;
        let least = footprint.variances.iter().fold(f64::INFINITY, |a, &b| a.min(b));
        let [mut xx, mut xy, mut yy] = [SLOPE_FLOOR, 0.0, SLOPE_FLOOR];
        let mut along = DVec2::ZERO;
        let mut depth_variance = 0.0;
        let axes = [footprint.axes.x_axis, footprint.axes.y_axis, footprint.axes.z_axis];
        for ((v, t), m) in footprint.variances.iter().zip(&footprint.spread).zip(axes) {
            let flat = v - least;
            xx += flat * t.x * t.x;
            xy += flat * t.x * t.y;
            yy += flat * t.y * t.y;
            along += *t * (flat * m.z);
            depth_variance += v * m.z * m.z;
        }
        let determinant = xx * yy - xy * xy;
        let slope = DVec2::new(yy * along.x - xy * along.y, xx * along.y - xy * along.x) / determinant;
        let slope = if slope.is_finite() { slope } else { DVec2::ZERO };
        let axis = axes[thinnest_axis(scene.log_scales[i])];
        let sight = if self.is_pinhole() { footprint.point } else { DVec3::Z };
        let outward = if axis.dot(sight) > 0.0 { -axis } else { axis };
        let normal = camera.rotation.transpose() * outward.as_vec3();
        Some(Surface {
            depth: footprint.point.z as f32,
            slope: [slope.x as f32, slope.y as f32],
            reach: (REACH_SIGMAS * depth_variance.sqrt()).min(SIGMA_MAX) as f32,
            normal: normal.to_array(),
        })
    }
}

/// The rotation of a quaternion of any length; the caller has checked that it has one.
fn rotation_matrix(q: DQuat) -> DMat3 {
    DMat3::from_quat(q.normalize())
}

/// All Gaussians on the screen, in scene order, and the depths of their centres.
pub(crate) fn project(scene: &Scene, view: &View, size: [usize; 2]) -> (Vec<Splat>, Vec<f32>) {
    let size = size.map(|s| s as f64);
    (0..scene.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| view.splat(scene, i, size).unwrap_or((Splat::UNSEEN, 0.0)))
        .unzip()
}

/// Colours of all Gaussians as seen by the camera, not below zero (3DGS); those not seen get black.
pub(crate) fn colors(scene: &Scene, camera: &Camera, splats: &[Splat]) -> Vec<[f32; 3]> {
    (0..scene.len())
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| {
            if splats[i].is_seen() {
                raw_color(scene, camera, i).map(|c| c.max(0.0))
            } else {
                [0.0; 3]
            }
        })
        .collect()
}

/// Colour of Gaussian `i` before it is held above zero.
pub(crate) fn raw_color(scene: &Scene, camera: &Camera, i: usize) -> [f32; 3] {
    let mut color = scene.color(i);
    if scene.sh_degree > 0 {
        let basis = sh::basis(scene.sh_degree, camera.direction_to(scene.centers[i]));
        let bands = sh::bands(scene.sh_degree);
        for (c, rest) in color.iter_mut().zip(scene.sh_rest_of(i).chunks_exact(bands)) {
            let sum: f64 = rest.iter().zip(&basis).map(|(&r, y)| f64::from(r) * y).sum();
            *c += sum as f32;
        }
    }
    color
}
