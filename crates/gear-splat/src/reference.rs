//! The slow, obvious rasteriser: f64, no tiles, every pixel looks at every Gaussian.
//!
//! Every faster one is held against this. It follows the same definition (1/255, 0.99, 1e-4, the 3DGS dilation, the
//! order of centre depths with ties by index, the depth of a contribution in its surfel's plane) but shares no code
//! with them: the covariance is a matrix, its inverse is the textbook one, and a pixel is a loop. It takes
//! O(pixels · Gaussians) time; give it small pictures.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3, DVec4};

use crate::render::{ALPHA_MAX, ALPHA_MIN, EDGE_ON, REACH_SIGMAS, RenderOptions, ScreenFilter, TRANSMITTANCE_MIN};
use crate::scene::thinnest_axis;
use crate::{Camera, Projection, Scene, sh};

/// A Gaussian with every attribute in f64.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussian64 {
    /// Centre.
    pub center: DVec3,
    /// Logarithms of the standard deviations.
    pub log_scale: DVec3,
    /// Quaternion x, y, z, w of any length.
    pub rotation: DVec4,
    /// Logit of the opacity.
    pub opacity_logit: f64,
    /// SH coefficients of degree 0.
    pub dc: [f64; 3],
    /// Higher SH coefficients, channel-major.
    pub rest: Vec<f64>,
}

/// The pictures, row-major, as [`crate::Rendering`] describes them.
#[derive(Clone, Debug, Default)]
pub struct Reference {
    /// Colour over the background.
    pub rgb: Vec<[f64; 3]>,
    /// Coverage.
    pub alpha: Vec<f64>,
    /// Expected depth, NaN where nothing is.
    pub depth: Vec<f64>,
    /// Median depth, NaN where less than half is covered.
    pub median_depth: Vec<f64>,
    /// World-space normals.
    pub normal: Vec<[f64; 3]>,
}

/// The valid Gaussians of a scene in f64.
pub fn gaussians(scene: &Scene) -> Vec<Gaussian64> {
    let valid = (0..scene.len()).filter(|&i| scene.is_valid(i));
    valid
        .map(|i| {
            let q = scene.rotations[i].as_dquat();
            Gaussian64 {
                center: scene.centers[i].as_dvec3(),
                log_scale: scene.log_scales[i].as_dvec3(),
                rotation: DVec4::new(q.x, q.y, q.z, q.w),
                opacity_logit: f64::from(scene.opacity_logits[i]),
                dc: scene.sh_dc[i].map(f64::from),
                rest: scene.sh_rest_of(i).iter().map(|&x| f64::from(x)).collect(),
            }
        })
        .collect()
}

/// Renders a scene.
pub fn render(scene: &Scene, camera: &Camera, options: &RenderOptions) -> Reference {
    render_gaussians(&gaussians(scene), scene.sh_degree, camera, options)
}

/// Renders a list of Gaussians whose `rest` has degree `sh_degree`.
pub fn render_gaussians(
    gaussians: &[Gaussian64],
    sh_degree: u8,
    camera: &Camera,
    options: &RenderOptions,
) -> Reference {
    let mut seen: Vec<Seen> = gaussians
        .iter()
        .filter_map(|g| see(g, sh_degree, camera, options))
        .collect();
    seen.sort_by(|a, b| a.center.z.total_cmp(&b.center.z)); // stable: ties keep scene order
    let mut out = Reference::default();
    for v in 0..camera.height {
        for u in 0..camera.width {
            pixel(&seen, DVec2::new(f64::from(u), f64::from(v)), options, &mut out);
        }
    }
    out
}

/// A Gaussian as the camera sees it.
struct Seen {
    center: DVec3,
    mean: DVec2,
    conic: DMat2,
    opacity: f64,
    color: [f64; 3],
    slope: DVec2,
    reach: f64,
    normal: DVec3,
}

fn see(gaussian: &Gaussian64, sh_degree: u8, camera: &Camera, options: &RenderOptions) -> Option<Seen> {
    let world_to_camera = camera.rotation.as_dmat3();
    let center = world_to_camera * gaussian.center + camera.translation.as_dvec3();
    let principal = DVec2::new(f64::from(camera.principal[0]), f64::from(camera.principal[1]));
    // Rows of the Jacobian, and the pixel of the centre.
    let (jacobian, mean, sight) = match camera.projection {
        Projection::Orthographic { pixels_per_unit } => {
            let s = f64::from(pixels_per_unit);
            let rows = [DVec3::X * s, DVec3::Y * s];
            (rows, principal + center.truncate() * s, DVec3::Z)
        }
        Projection::Pinhole { focal_px } => {
            if center.z < f64::from(options.near) {
                return None;
            }
            let f = f64::from(focal_px);
            let [lx, ly] = [camera.width, camera.height].map(|side| 1.3 * 0.5 * f64::from(side) / f);
            let (tx, ty) = (
                (center.x / center.z).clamp(-lx, lx),
                (center.y / center.z).clamp(-ly, ly),
            );
            let rows = [
                DVec3::new(f, 0.0, -f * tx) / center.z,
                DVec3::new(0.0, f, -f * ty) / center.z,
            ];
            (rows, principal + center.truncate() * (f / center.z), center)
        }
    };
    let q = gaussian.rotation.normalize();
    let axes = world_to_camera * DMat3::from_quat(DQuat::from_xyzw(q.x, q.y, q.z, q.w));
    let scale = DVec3::from(gaussian.log_scale.to_array().map(libm::exp));
    let covariance = |variances: DVec3| axes * DMat3::from_diagonal(variances) * axes.transpose();
    let on_screen = |m: DMat3, add: f64| {
        let entry = |a: usize, b: usize| jacobian[a].dot(m * jacobian[b]);
        DMat2::from_cols_array(&[entry(0, 0) + add, entry(0, 1), entry(0, 1), entry(1, 1) + add])
    };

    let full = covariance(scale * scale);
    let variance = options.filter.variance();
    let dilated = on_screen(full, variance);
    let mut opacity = crate::sigmoid(gaussian.opacity_logit);
    if let ScreenFilter::AntiAlias(_) = options.filter {
        opacity *= (on_screen(full, 0.0).determinant().max(0.0) / dilated.determinant()).sqrt();
    }

    let least = (scale * scale).min_element();
    let flat = covariance(scale * scale - DVec3::splat(least));
    let along = DVec2::new(jacobian[0].dot(flat * DVec3::Z), jacobian[1].dot(flat * DVec3::Z));
    let slope = on_screen(flat, 1e-4).inverse() * along;

    let thinnest = axes.col(thinnest_axis(gaussian.log_scale.as_vec3()));
    let outward = if thinnest.dot(sight) > EDGE_ON * sight.length() {
        -thinnest
    } else {
        thinnest
    };

    Some(Seen {
        center,
        mean,
        conic: dilated.inverse(),
        opacity,
        color: color(gaussian, sh_degree, camera),
        slope,
        reach: REACH_SIGMAS * full.z_axis.z.sqrt(),
        normal: world_to_camera.transpose() * outward,
    })
}

fn color(gaussian: &Gaussian64, sh_degree: u8, camera: &Camera) -> [f64; 3] {
    let direction = match camera.projection {
        Projection::Orthographic { .. } => camera.forward().as_dvec3(),
        Projection::Pinhole { .. } => (gaussian.center - camera.position().as_dvec3()).normalize_or_zero(),
    };
    let basis = sh::basis_at(sh_degree, direction);
    let bands = sh::bands(sh_degree);
    std::array::from_fn(|c| {
        let higher: f64 = (0..bands).map(|k| gaussian.rest[c * bands + k] * basis[k]).sum();
        (0.5 + f64::from(sh::Y0) * gaussian.dc[c] + higher).max(0.0)
    })
}

fn pixel(seen: &[Seen], at: DVec2, options: &RenderOptions, out: &mut Reference) {
    let mut transmittance = 1.0;
    let mut rgb = [0.0; 3];
    let (mut weight, mut depth, mut median) = (0.0, 0.0, f64::NAN);
    let mut normal = DVec3::ZERO;
    for g in seen {
        if transmittance < f64::from(TRANSMITTANCE_MIN) {
            break;
        }
        let d = at - g.mean;
        let alpha = (g.opacity * libm::exp(-0.5 * d.dot(g.conic * d))).min(f64::from(ALPHA_MAX));
        if alpha.is_nan() || alpha < f64::from(ALPHA_MIN) {
            continue;
        }
        let w = alpha * transmittance;
        let z = g.center.z + g.slope.dot(d).clamp(-g.reach, g.reach);
        for c in 0..3 {
            rgb[c] += w * g.color[c];
        }
        weight += w;
        depth += w * z;
        normal += g.normal * w;
        let after = transmittance * (1.0 - alpha);
        if transmittance > 0.5 && after <= 0.5 {
            median = z;
        }
        transmittance = after;
    }
    for c in 0..3 {
        rgb[c] += transmittance * f64::from(options.background[c]);
    }
    out.rgb.push(rgb);
    out.alpha.push(1.0 - transmittance);
    out.depth.push(if weight > 0.0 { depth / weight } else { f64::NAN });
    out.median_depth.push(median);
    out.normal.push(normal.normalize_or_zero().to_array());
}
