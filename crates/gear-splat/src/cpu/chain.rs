//! Stage 6: the chain rule from an ellipse on the screen back to a Gaussian in the world, in f64.

use glam::{DMat3, DVec2, DVec3, DVec4, Quat, Vec3, Vec4};
use rayon::prelude::*;

use super::Frame;
use super::gradient::Sums;
use super::project::{Footprint, Splat, raw_color};
use crate::render::{SceneGradients, ScreenFilter, Wanted};
use crate::scene::sigmoid;
use crate::{Scene, sh};

/// Derivatives by one Gaussian's attributes.
#[derive(Clone, Copy, Default)]
struct Gradient {
    center: Vec3,
    log_scale: Vec3,
    rotation: Vec4,
    opacity_logit: f32,
    dc: [f32; 3],
}

/// Derivatives by the scene's attributes. Gaussians that the camera does not see get zeros.
pub(crate) fn to_scene(frame: &Frame, scene: &Scene, sums: &[Sums], wanted: Wanted) -> SceneGradients {
    let stride = scene.sh_rest_stride();
    let mut rest = vec![0.0; scene.sh_rest.len()];
    let mut all = vec![Gradient::default(); scene.len()];
    // Gaussians without higher SH have an empty slice of `rest` each.
    let mut rests: Vec<&mut [f32]> = if stride == 0 {
        Vec::new()
    } else {
        rest.chunks_exact_mut(stride).collect()
    };
    rests.resize_with(scene.len(), Default::default);
    all.par_iter_mut()
        .zip(rests)
        .enumerate()
        .with_min_len(1024)
        .for_each(|(i, (gradient, rest))| {
            if frame.splats[i].is_seen() {
                *gradient = one(frame, scene, i, &sums[i], wanted, rest);
            }
        });
    let mut gradients = SceneGradients {
        sh_dc: all.iter().map(|g| g.dc).collect(),
        sh_rest: rest,
        ..SceneGradients::default()
    };
    if wanted == Wanted::All {
        gradients.centers = all.iter().map(|g| g.center).collect();
        gradients.log_scales = all.iter().map(|g| g.log_scale).collect();
        gradients.rotations = all.iter().map(|g| g.rotation).collect();
        gradients.opacity_logits = all.iter().map(|g| g.opacity_logit).collect();
    }
    gradients
}

fn one(frame: &Frame, scene: &Scene, i: usize, sums: &Sums, wanted: Wanted, rest: &mut [f32]) -> Gradient {
    let mut gradient = Gradient::default();
    let by_direction = color(frame, scene, i, sums, &mut gradient, rest);
    if wanted == Wanted::Color {
        return gradient;
    }
    let Some(footprint) = frame.view.footprint(scene, i) else {
        return gradient;
    };
    let by_ellipse = ellipse(&frame.splats[i], &footprint, sums);

    let opacity = sigmoid(f64::from(scene.opacity_logits[i]));
    let by_log_opacity = f64::from(sums.moments[0]);
    gradient.opacity_logit = (by_log_opacity * (1.0 - opacity)) as f32;

    let mut by_covariance = by_ellipse.covariance;
    if let ScreenFilter::AntiAlias(_) = frame.view.filter {
        let by_compensation = compensation(&footprint, by_log_opacity, frame.view.filter.variance());
        for (a, b) in by_covariance.iter_mut().zip(by_compensation) {
            *a += b;
        }
    }

    // Σ = Σ_k v_k t_k t_kᵀ; the off-diagonal entry stands twice in the matrix and once in `by_covariance`.
    let [gxx, gxy, gyy] = by_covariance;
    let mut by_axes = [DVec3::ZERO; 3];
    let mut by_jacobian = [DVec3::ZERO; 2];
    let mut by_log_scale = DVec3::ZERO;
    let (s, slopes) = frame.view.linearised(footprint.point);
    let axes = [footprint.axes.x_axis, footprint.axes.y_axis, footprint.axes.z_axis];
    for k in 0..3 {
        let (v, t) = (footprint.variances[k], footprint.spread[k]);
        let by_t = DVec2::new(2.0 * gxx * t.x + gxy * t.y, 2.0 * gyy * t.y + gxy * t.x) * v;
        by_log_scale[k] = by_t.dot(t);
        // t = J m with J = [s 0 −s·tx; 0 s −s·ty].
        by_axes[k] = DVec3::new(by_t.x, by_t.y, -(slopes[0] * by_t.x + slopes[1] * by_t.y)) * s;
        by_jacobian[0] += axes[k] * by_t.x;
        by_jacobian[1] += axes[k] * by_t.y;
    }
    gradient.log_scale = by_log_scale.as_vec3();

    let mut by_point = DVec3::new(by_ellipse.mean.x, by_ellipse.mean.y, 0.0) * s;
    if frame.view.is_pinhole() {
        by_point += pinhole(frame, &footprint, by_ellipse.mean, by_jacobian);
    }
    let to_world = frame.view.rotation.transpose();
    gradient.center = (to_world * by_point + by_direction).as_vec3();
    let by_rotation = to_world * DMat3::from_cols(by_axes[0], by_axes[1], by_axes[2]);
    gradient.rotation = quaternion(scene.rotations[i], by_rotation).as_vec4();
    gradient
}

/// Colour: derivatives by SH coefficients; returns the derivative by the centre through the viewing direction.
fn color(frame: &Frame, scene: &Scene, i: usize, sums: &Sums, gradient: &mut Gradient, rest: &mut [f32]) -> DVec3 {
    let shown = raw_color(scene, &frame.camera, i);
    let by_color: [f32; 3] = std::array::from_fn(|c| if shown[c] >= 0.0 { sums.color[c] } else { 0.0 });
    gradient.dc = by_color.map(|g| g * sh::Y0);
    if rest.is_empty() {
        return DVec3::ZERO;
    }
    let direction = frame.camera.direction_to(scene.centers[i]);
    let basis = sh::basis(scene.sh_degree, direction);
    let slopes = sh::basis_gradient(scene.sh_degree, direction);
    let bands = sh::bands(scene.sh_degree);
    let mut by_direction = DVec3::ZERO;
    let coefficients = scene.sh_rest_of(i).chunks_exact(bands);
    for ((g, out), coefficients) in by_color.iter().zip(rest.chunks_exact_mut(bands)).zip(coefficients) {
        for (k, out) in out.iter_mut().enumerate() {
            *out = (f64::from(*g) * basis[k]) as f32;
            by_direction += slopes[k] * f64::from(*g) * f64::from(coefficients[k]);
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
fn ellipse(splat: &Splat, footprint: &Footprint, sums: &Sums) -> ByEllipse {
    let [_, e, ee, d, ed, dd] = sums.moments.map(f64::from);
    let [_, xy, yy] = footprint.covariance;
    let precision_x = yy / footprint.determinants[1];
    let (shear, precision_y) = (xy / yy, 1.0 / yy);
    debug_assert!(splat.is_seen());
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
