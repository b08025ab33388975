//! Stage 6: the chain rule from an ellipse on the screen back to a Gaussian in the world, in f64.

use glam::{DMat3, DVec2, DVec3, DVec4, Quat, Vec3, Vec4};
use rayon::prelude::*;

use super::Frame;
use super::blend_backward::{Gathered, Sums, SurfaceSums};
use super::color::raw_color;
use super::project::{Footprint, LOGIT_MAX};
use super::surface;
use crate::render::{REACH_SIGMAS, SceneGradients, ScreenFilter, Wanted};
use crate::scene::sigmoid;
use crate::{Scene, sh};

/// Rank of a Gaussian that the camera does not see.
const UNSEEN: u32 = u32::MAX;

/// Derivatives by one Gaussian's attributes.
#[derive(Clone, Copy, Default)]
struct Gradient {
    center: Vec3,
    log_scale: Vec3,
    rotation: Vec4,
    opacity_logit: f32,
    dc: [f32; 3],
}

/// Derivatives by the scene's attributes. Gaussians that the camera does not see, or that the loss does not, get zeros.
pub(crate) fn to_scene(frame: &Frame, scene: &Scene, sums: &Gathered, wanted: Wanted) -> SceneGradients {
    let mut ranks = vec![UNSEEN; frame.total];
    for (rank, &id) in frame.ids.iter().enumerate() {
        ranks[id as usize] = rank as u32;
    }
    let stride = scene.sh_rest_stride();
    let mut rest = vec![0.0; if wanted.colors { scene.sh_rest.len() } else { 0 }];
    let mut all = vec![Gradient::default(); frame.total];
    // Gaussians without higher SH, or with frozen ones, have an empty slice of `rest` each.
    let mut rests: Vec<&mut [f32]> = Vec::new();
    if !rest.is_empty() {
        rests.extend(rest.chunks_exact_mut(stride));
    }
    rests.resize_with(frame.total, Default::default);
    let tasks = all.par_iter_mut().zip(rests).zip(&ranks).enumerate();
    tasks.with_min_len(1024).for_each(|(i, ((gradient, rest), &rank))| {
        if rank != UNSEEN {
            let rank = rank as usize;
            let by_surface = sums.surfaces.get(rank).copied().unwrap_or_default();
            let by_splat = &sums.sums[rank];
            if !by_splat.is_zero() || by_surface != SurfaceSums::default() {
                *gradient = one(frame, scene, i, by_splat, &by_surface, wanted, rest);
            }
        }
    });
    /// A group that is wanted, and an empty one otherwise.
    fn group<T: Send>(all: &[Gradient], wanted: bool, of: impl Fn(&Gradient) -> T + Sync + Send) -> Vec<T> {
        if wanted {
            all.par_iter().with_min_len(8192).map(of).collect()
        } else {
            Vec::new()
        }
    }
    SceneGradients {
        centers: group(&all, wanted.centers, |g| g.center),
        log_scales: group(&all, wanted.log_scales, |g| g.log_scale),
        rotations: group(&all, wanted.rotations, |g| g.rotation),
        opacity_logits: group(&all, wanted.opacity_logits, |g| g.opacity_logit),
        sh_dc: group(&all, wanted.colors, |g| g.dc),
        sh_rest: rest,
    }
}

fn one(
    frame: &Frame,
    scene: &Scene,
    i: usize,
    sums: &Sums,
    by_surface: &SurfaceSums,
    wanted: Wanted,
    rest: &mut [f32],
) -> Gradient {
    let mut gradient = Gradient::default();
    let by_direction = if frame.needs_color_sums(wanted) {
        color(frame, scene, i, sums, &mut gradient, rest)
    } else {
        DVec3::ZERO
    };
    let by_log_opacity = f64::from(sums.moments[0]);
    let logit = f64::from(scene.opacity_logits[i]);
    if logit.abs() <= LOGIT_MAX {
        gradient.opacity_logit = (by_log_opacity * (1.0 - sigmoid(logit))) as f32;
    }
    if !(wanted.centers || wanted.log_scales || wanted.rotations) {
        return gradient;
    }
    let footprint = frame.view.footprint_of(scene, i);
    let by_ellipse = ellipse(&footprint, sums);
    let mut by = Intermediate {
        mean: by_ellipse.mean,
        ..Intermediate::default()
    };
    let mut by_covariance = by_ellipse.covariance;
    if let ScreenFilter::AntiAlias(_) = frame.view.filter {
        let by_compensation = compensation(&footprint, by_log_opacity, frame.view.filter.variance());
        for (a, b) in by_covariance.iter_mut().zip(by_compensation) {
            *a += b;
        }
    }
    by.covariance(&footprint, by_covariance);
    if *by_surface != SurfaceSums::default() {
        by.surface(frame, scene, i, &footprint, by_surface);
    }

    // t = J m with J = [s 0 −s·tx; 0 s −s·ty].
    let mut by_jacobian = [DVec3::ZERO; 2];
    let (s, slopes) = frame.view.linearised(footprint.point);
    for k in 0..3 {
        let by_t = by.spread[k];
        by.axes[k] += DVec3::new(by_t.x, by_t.y, -(slopes[0] * by_t.x + slopes[1] * by_t.y)) * s;
        by_jacobian[0] += footprint.axes[k] * by_t.x;
        by_jacobian[1] += footprint.axes[k] * by_t.y;
        gradient.log_scale[k] = (2.0 * by.variances[k] * footprint.variances[k]) as f32;
    }
    let mut by_point = DVec3::new(by.mean.x * s, by.mean.y * s, by.depth);
    if frame.view.is_pinhole() {
        by_point += pinhole(frame, &footprint, by.mean, by_jacobian);
    }
    let to_world = frame.view.rotation.transpose();
    gradient.center = (to_world * by_point + by_direction).as_vec3();
    let by_rotation = to_world * DMat3::from_cols(by.axes[0], by.axes[1], by.axes[2]);
    gradient.rotation = quaternion(scene.rotations[i], by_rotation).as_vec4();
    gradient
}

/// Derivatives by what lies between the picture and the attributes.
#[derive(Default)]
struct Intermediate {
    mean: DVec2,
    /// By the depth of the centre.
    depth: f64,
    /// By the squared standard deviations.
    variances: [f64; 3],
    /// By the projected axes.
    spread: [DVec2; 3],
    /// By the camera-space axes, other than through the projected ones.
    axes: [DVec3; 3],
}

impl Intermediate {
    /// Σ = Σ_k v_k t_k t_kᵀ; the off-diagonal entry stands twice in the matrix and once in `by`.
    fn covariance(&mut self, footprint: &Footprint, by: [f64; 3]) {
        let [gxx, gxy, gyy] = by;
        for k in 0..3 {
            let t = footprint.spread[k];
            let half = DVec2::new(2.0 * gxx * t.x + gxy * t.y, 2.0 * gyy * t.y + gxy * t.x);
            self.spread[k] += half * footprint.variances[k];
            self.variances[k] += 0.5 * half.dot(t);
        }
    }

    /// The surfel's plane, `surface::plane`: slope = F⁻¹ a with F = Σ_k f_k t_k t_kᵀ + floor, a = Σ_k f_k t_k m_kz and
    /// f_k = v_k − v_min. With λ = F⁻¹ ∂ℓ/∂slope: dℓ = λ·da − λ·dF·slope.
    fn surface(&mut self, frame: &Frame, scene: &Scene, i: usize, footprint: &Footprint, by: &SurfaceSums) {
        let plane = surface::plane(footprint);
        let [free, by_slope @ ..] = by.plane.map(f64::from);
        self.depth += f64::from(by.depth);
        self.mean -= plane.slope * free;

        let [xx, xy, yy] = plane.flat;
        let determinant = xx * yy - xy * xy;
        let [gx, gy] = by_slope;
        let lambda = DVec2::new(yy * gx - xy * gy, xx * gy - xy * gx) / determinant;
        if lambda.is_finite() {
            let variances = footprint.variances;
            let least = (0..3).fold(2, |least, k| if variances[k] < variances[least] { k } else { least });
            for k in 0..3 {
                let (t, z) = (footprint.spread[k], footprint.axes[k].z);
                let flat = variances[k] - variances[least];
                let (along, across) = (lambda.dot(t), plane.slope.dot(t));
                let by_flat = along * (z - across);
                self.variances[k] += by_flat;
                self.variances[least] -= by_flat;
                self.spread[k] += (lambda * (z - across) - plane.slope * along) * flat;
                self.axes[k].z += flat * along;
            }
        }
        // reach = c·√(Σ_k v_k m_kz²).
        let deviation = plane.depth_variance.sqrt();
        if deviation > 0.0 {
            let by_variance = f64::from(by.reach) * REACH_SIGMAS * 0.5 / deviation;
            for k in 0..3 {
                let z = footprint.axes[k].z;
                self.variances[k] += by_variance * z * z;
                self.axes[k].z += by_variance * 2.0 * footprint.variances[k] * z;
            }
        }
        let (axis, normal) = surface::outward(&frame.view, footprint, scene.log_scales[i].as_dvec3());
        let sign = if normal == footprint.axes[axis] { 1.0 } else { -1.0 };
        let by_normal = DVec3::from(by.normal.map(f64::from));
        self.axes[axis] += frame.view.rotation * by_normal * sign;
    }
}

/// Colour: derivatives by SH coefficients; returns the derivative by the centre through the viewing direction.
fn color(frame: &Frame, scene: &Scene, i: usize, sums: &Sums, gradient: &mut Gradient, rest: &mut [f32]) -> DVec3 {
    let shown = raw_color(scene, &frame.camera, i);
    let by_color: [f32; 3] = std::array::from_fn(|c| if shown[c] >= 0.0 { sums.color[c] } else { 0.0 });
    gradient.dc = by_color.map(|g| g * sh::Y0);
    let bands = sh::bands(scene.sh_degree);
    if bands == 0 {
        return DVec3::ZERO;
    }
    let direction = frame.camera.direction_to(scene.centers[i]);
    let basis = sh::basis(scene.sh_degree, direction);
    let slopes = sh::basis_gradient(scene.sh_degree, direction);
    let mut by_direction = DVec3::ZERO;
    for (c, coefficients) in scene.sh_rest_of(i).chunks_exact(bands).enumerate() {
        let g = f64::from(by_color[c]);
        for (k, &coefficient) in coefficients.iter().enumerate() {
            by_direction += slopes[k] * g * f64::from(coefficient);
            // Absent when colours are frozen.
            if let Some(out) = rest.get_mut(c * bands + k) {
                *out = (g * basis[k]) as f32;
            }
        }
    }
    if !frame.view.is_pinhole() {
        return DVec3::ZERO;
    }
    // direction = (p − eye)/|p − eye|.
    let d = direction.as_dvec3();
    let distance = f64::from((scene.centers[i] - frame.camera.position()).length()).max(1e-12);
    (by_direction - d * d.dot(by_direction)) / distance
}

struct ByEllipse {
    mean: DVec2,
    covariance: [f64; 3],
}

/// From the moments of h to the mean and the covariance. With P_x = Σyy/det, k = Σxy/Σyy, P_y = 1/Σyy:
/// dP_x = P_x²(−dΣxx + 2k dΣxy − k² dΣyy), dk = P_y(dΣxy − k dΣyy), dP_y = −P_y² dΣyy.
fn ellipse(footprint: &Footprint, sums: &Sums) -> ByEllipse {
    let [_, e, ee, d, ed, dd] = sums.moments.map(f64::from);
    let [_, xy, yy] = footprint.covariance;
    let precision_x = yy / footprint.determinants[1];
    let (shear, precision_y) = (xy / yy, 1.0 / yy);
    let by_precision_x = -0.5 * ee * precision_x * precision_x;
    let by_shear = precision_x * ed * precision_y;
    let by_precision_y = -0.5 * dd * precision_y * precision_y;
    ByEllipse {
        mean: DVec2::new(precision_x * e, precision_y * d - precision_x * shear * e),
        covariance: [
            -by_precision_x,
            2.0 * shear * by_precision_x + by_shear,
            -shear * shear * by_precision_x - shear * by_shear - by_precision_y,
        ],
    }
}

/// The filter's share: log opacity gains ½(log det₀ − log det).
fn compensation(footprint: &Footprint, by_log_opacity: f64, delta: f64) -> [f64; 3] {
    let [xx, xy, yy] = footprint.covariance;
    let [before, after] = footprint.determinants;
    let half = 0.5 * by_log_opacity;
    [
        half * ((yy - delta) / before - yy / after),
        half * 2.0 * xy * (1.0 / after - 1.0 / before),
        half * ((xx - delta) / before - xx / after),
    ]
}

/// The derivative by the camera-space centre through z of the mean and through the Jacobian.
fn pinhole(frame: &Frame, footprint: &Footprint, by_mean: DVec2, by_jacobian: [DVec3; 2]) -> DVec3 {
    let p = footprint.point;
    let (s, slopes) = frame.view.linearised(p);
    let inside = frame.view.inside_limit(p);
    // mean = principal + s·(x, y), s = f/z.
    let mut out = DVec3::new(0.0, 0.0, -s / p.z * (by_mean.x * p.x + by_mean.y * p.y));
    for row in 0..2 {
        let by = by_jacobian[row];
        let by_scale = by[row] - slopes[row] * by.z;
        out.z -= by_scale * s / p.z;
        if inside[row] {
            let by_slope = -s * by.z;
            out[row] += by_slope / p.z;
            out.z -= by_slope * slopes[row] / p.z;
        }
    }
    out
}

/// From the rotation matrix to the quaternion as stored: R(q/|q|).
fn quaternion(q: Quat, by_matrix: DMat3) -> DVec4 {
    let q = q.as_dquat();
    let length = q.length();
    let (x, y, z, w) = (q.x / length, q.y / length, q.z / length, q.w / length);
    let m = |row: usize, column: usize| by_matrix.col(column)[row];
    let by_unit = DVec4::new(
        -4.0 * x * (m(1, 1) + m(2, 2))
            + 2.0 * (y * (m(0, 1) + m(1, 0)) + z * (m(0, 2) + m(2, 0)) + w * (m(2, 1) - m(1, 2))),
        -4.0 * y * (m(0, 0) + m(2, 2))
            + 2.0 * (x * (m(0, 1) + m(1, 0)) + z * (m(1, 2) + m(2, 1)) + w * (m(0, 2) - m(2, 0))),
        -4.0 * z * (m(0, 0) + m(1, 1))
            + 2.0 * (x * (m(0, 2) + m(2, 0)) + y * (m(1, 2) + m(2, 1)) + w * (m(1, 0) - m(0, 1))),
        2.0 * (x * (m(2, 1) - m(1, 2)) + y * (m(0, 2) - m(2, 0)) + z * (m(1, 0) - m(0, 1))),
    );
    let unit = DVec4::new(x, y, z, w);
    (by_unit - unit * unit.dot(by_unit)) / length
}
