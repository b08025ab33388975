//! Depth, normals, detail and silhouette of a height map beside the true one.

use gear_image::{Field, Mask};

use crate::fields::{dot, eroded, normals, weighted_gaussian, zip};

/// Standard deviation of the Gaussian that parts detail from body, share of the longer side.
const BODY: f64 = 0.04;
/// Detail is compared this far inside the silhouettes, share of the longer side.
const DETAIL_RIM: f32 = 0.03;
/// Normals are compared this far inside the silhouettes, share of the longer side; at least 2 px.
const NORMAL_RIM: f32 = 0.01;

/// How far a height map is from the truth. `None` where a figure is not defined: no pixel to compare, a flat truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceError {
    /// RMS of `truth − (a·z + b)` after the best fit with a ≥ 0, over the truth's standard deviation.
    pub depth: Option<f64>,
    /// a of that fit: by how much the estimate has to be deepened.
    pub scale: Option<f64>,
    /// Mean angle between the surfaces' normals, degrees.
    pub normals_degrees: Option<f64>,
    /// The same after the fit.
    pub fitted_normals_degrees: Option<f64>,
    /// Correlation of the high-passed heights.
    pub detail: Option<f64>,
    /// Intersection over union of the silhouettes; `None` when both are empty.
    pub silhouette: Option<f64>,
    /// Pixels inside both silhouettes.
    pub pixels: usize,
}

/// Compares two maps of world z towards the viewer, in units of the picture's longer side, NaN outside the figure.
///
/// # Panics
/// When the maps differ in size.
pub fn surface_error(estimate: &Field, truth: &Field) -> SurfaceError {
    assert_eq!(estimate.size(), truth.size(), "heights of one size are compared");
    let (ours, theirs) = (finite(estimate), finite(truth));
    let both = both(&ours, &theirs);
    let fit = Fit::of(estimate, truth, &both);
    let side = both.longer_side() as f32;
    let share = |share: f32, least: f32| (share * side).max(least).round() as u32;
    let truth_normals = normals(&in_pixels(truth, &theirs, 1.0));
    let angle = |scale: f64| {
        let estimated = normals(&in_pixels(estimate, &ours, scale as f32));
        mean_angle(&estimated, &truth_normals, &eroded(&both, share(NORMAL_RIM, 2.0)))
    };
    SurfaceError {
        depth: fit.as_ref().and_then(|f| f.error),
        scale: fit.as_ref().map(|f| f.scale),
        normals_degrees: angle(1.0),
        fitted_normals_degrees: fit.as_ref().and_then(|f| angle(f.scale)),
        detail: detail_correlation(estimate, truth, &both, &eroded(&both, share(DETAIL_RIM, 1.0))),
        silhouette: silhouette_iou(&ours, &theirs),
        pixels: both.count(),
    }
}

/// Mean angle in degrees between two maps of unit normals over `where_`; vectors of no length do not count.
pub fn mean_angle(a: &[[f32; 3]], b: &[[f32; 3]], where_: &Mask) -> Option<f64> {
    let long = |n: &[f32; 3]| dot(*n, *n) > 0.25;
    let (mut sum, mut count) = (0.0f64, 0usize);
    for ((a, b), _) in a
        .iter()
        .zip(b)
        .zip(where_.data())
        .filter(|((a, b), inside)| **inside && long(a) && long(b))
    {
        let lengths = (f64::from(dot(*a, *a)) * f64::from(dot(*b, *b))).sqrt();
        sum += libm::acos((f64::from(dot(*a, *b)) / lengths).clamp(-1.0, 1.0)).to_degrees();
        count += 1;
    }
    (count > 0).then(|| sum / count as f64)
}

/// Intersection over union; `None` when both are empty.
pub fn silhouette_iou(a: &Mask, b: &Mask) -> Option<f64> {
    let pairs = || a.data().iter().zip(b.data());
    let union = pairs().filter(|(a, b)| **a || **b).count();
    let shared = pairs().filter(|(a, b)| **a && **b).count();
    (union > 0).then(|| shared as f64 / union as f64)
}

/// Where a map says something.
pub fn finite(field: &Field) -> Mask {
    Mask::from_vec(
        field.width(),
        field.height(),
        field.data().iter().map(|z| z.is_finite()).collect(),
    )
}

fn both(a: &Mask, b: &Mask) -> Mask {
    let data = a.data().iter().zip(b.data()).map(|(a, b)| *a && *b).collect();
    Mask::from_vec(a.width(), a.height(), data)
}

/// World z as height in pixels, deepened, 0 outside.
fn in_pixels(z: &Field, inside: &Mask, deepened: f32) -> Field {
    let side = deepened * z.longer_side() as f32;
    let data = z.data().iter().zip(inside.data());
    Field::from_vec(
        z.width(),
        z.height(),
        data.map(|(&z, &inside)| if inside { side * z } else { 0.0 }).collect(),
    )
}

/// The best `truth ≈ a·estimate + b` with a ≥ 0.
struct Fit {
    scale: f64,
    error: Option<f64>,
}

impl Fit {
    fn of(estimate: &Field, truth: &Field, both: &Mask) -> Option<Self> {
        let pairs = || {
            let values = estimate.data().iter().zip(truth.data()).zip(both.data());
            values
                .filter(|(_, inside)| **inside)
                .map(|((&e, &t), _)| (f64::from(e), f64::from(t)))
        };
        let n = both.count() as f64;
        if n == 0.0 {
            return None;
        }
        let (sum_e, sum_t) = pairs().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
        let (mean_e, mean_t) = (sum_e / n, sum_t / n);
        let (mut ee, mut et, mut tt) = (0.0, 0.0, 0.0);
        for (e, t) in pairs() {
            let (e, t) = (e - mean_e, t - mean_t);
            ee += e * e;
            et += e * t;
            tt += t * t;
        }
        // A surface that is flat to rounding says nothing about scale.
        let scale = if ee > 1e-12 * n { (et / ee).max(0.0) } else { 0.0 };
        let left = (tt - 2.0 * scale * et + scale * scale * ee).max(0.0);
        Some(Self {
            scale,
            error: (tt > 1e-12 * n).then(|| (left / tt).sqrt()),
        })
    }
}

/// Pearson correlation inside `core` of what is left of both maps without their local planes over `both`.
fn detail_correlation(estimate: &Field, truth: &Field, both: &Mask, core: &Mask) -> Option<f64> {
    let planes = LocalPlanes::new(both, BODY * truth.longer_side() as f64);
    let high = |z: &Field| -> Vec<f64> {
        let left = planes.high_pass(&in_pixels(z, both, 1.0));
        let kept = left.iter().zip(core.data()).filter(|(_, inside)| **inside);
        kept.map(|(h, _)| f64::from(*h)).collect()
    };
    let (a, b) = (high(estimate), high(truth));
    let n = a.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (ma, mb) = (mean(&a), mean(&b));
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(&b) {
        aa += (a - ma) * (a - ma);
        ab += (a - ma) * (b - mb);
        bb += (b - mb) * (b - mb);
    }
    // Heights are pixels here: a thousandth of one is rounding.
    (n > 1.0 && bb > 1e-6 * n).then(|| if aa > 1e-6 * n { ab / (aa * bb).sqrt() } else { 0.0 })
}

/// Least-squares planes under a Gaussian window round every pixel of a mask (normalised convolution of first order). A
/// mean alone lies beside its pixel where the mask ends, and takes a slope for detail there.
struct LocalPlanes {
    weight: Field,
    sigma: f64,
    /// Windowed means of x, y.
    center: [Field; 2],
    /// Windowed covariances xx, xy, yy.
    spread: [Field; 3],
}

impl LocalPlanes {
    fn new(mask: &Mask, sigma: f64) -> Self {
        let (width, height) = mask.size();
        let weight = mask.to_field();
        // In units of σ about the middle, which single precision can bear.
        let x = Field::from_fn(width, height, |x, _| Self::place(x, width, sigma));
        let y = Field::from_fn(width, height, |_, y| Self::place(y, height, sigma));
        let mean = |f: &Field| weighted_gaussian(f, &weight, sigma);
        let (mx, my) = (mean(&x), mean(&y));
        let covariance = |a: &Field, b: &Field, ma: &Field, mb: &Field| {
            let product = mean(&zip(a, b, |a, b| a * b));
            zip(&product, &zip(ma, mb, |a, b| a * b), |p, m| p - m)
        };
        let spread = [
            covariance(&x, &x, &mx, &mx),
            covariance(&x, &y, &mx, &my),
            covariance(&y, &y, &my, &my),
        ];
        Self {
            weight,
            sigma,
            center: [mx, my],
            spread,
        }
    }

    fn place(index: usize, size: usize, sigma: f64) -> f32 {
        ((index as f64 - 0.5 * size as f64) / sigma) as f32
    }

    /// What the planes of `z` leave of it.
    fn high_pass(&self, z: &Field) -> Vec<f32> {
        let (width, height) = z.size();
        let mean = |f: &Field| weighted_gaussian(f, &self.weight, self.sigma);
        let along_x = Field::from_fn(width, height, |x, y| z.at(x, y) * Self::place(x, width, self.sigma));
        let along_y = Field::from_fn(width, height, |x, y| z.at(x, y) * Self::place(y, height, self.sigma));
        let (mz, xz, yz) = (mean(z), mean(&along_x), mean(&along_y));
        let [mx, my] = [&self.center[0], &self.center[1]].map(Field::data);
        let [xx, xy, yy] = [&self.spread[0], &self.spread[1], &self.spread[2]].map(Field::data);
        (0..z.len())
            .map(|p| {
                let (cx, cy) = (xz.data()[p] - mx[p] * mz.data()[p], yz.data()[p] - my[p] * mz.data()[p]);
                // A little stiffness: a window that is a line has no slope across it.
                let (a, c) = (xx[p] + 1e-2, yy[p] + 1e-2);
                let determinant = (a * c - xy[p] * xy[p]).max(1e-4);
                let (sx, sy) = ((c * cx - xy[p] * cy) / determinant, (a * cy - xy[p] * cx) / determinant);
                let dx = Self::place(p % width, width, self.sigma) - mx[p];
                let dy = Self::place(p / width, height, self.sigma) - my[p];
                z.data()[p] - (mz.data()[p] + sx * dx + sy * dy)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 96;

    /// A hemisphere, squeezed in depth, with waves.
    fn dome(depth: f32, shift: f32, waves: f32) -> Field {
        Field::from_fn(SIDE, SIDE, |x, y| {
            let (u, v) = ((x as f32 - 47.5) / 40.0, (y as f32 - 47.5) / 40.0);
            let round = 1.0 - u * u - v * v;
            if round > 0.0 {
                depth * 40.0 / 96.0 * round.sqrt() + shift + waves * gear_image::math::sin(0.9 * x as f32)
            } else {
                f32::NAN
            }
        })
    }

    #[test]
    fn the_truth_has_no_error() {
        let error = surface_error(&dome(1.0, 0.0, 0.01), &dome(1.0, 0.0, 0.01));
        assert!(
            error.depth.unwrap() < 1e-6 && error.normals_degrees.unwrap() < 0.05,
            "{error:?}"
        );
        assert!((error.detail.unwrap() - 1.0).abs() < 1e-6 && error.silhouette == Some(1.0));
        assert!((error.scale.unwrap() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn depth_does_not_know_distance_and_scale_and_normals_know_scale() {
        let error = surface_error(&dome(0.5, 3.0, 0.0), &dome(1.0, 0.0, 0.0));
        assert!(error.depth.unwrap() < 1e-3, "{error:?}");
        assert!((error.scale.unwrap() - 2.0).abs() < 1e-3);
        assert!(
            error.normals_degrees.unwrap() > 8.0 && error.fitted_normals_degrees.unwrap() < 0.1,
            "{error:?}"
        );
    }

    #[test]
    fn a_plane_explains_nothing_and_a_mould_no_more_than_a_plane() {
        let flat = dome(0.0, 1.0, 0.0);
        let error = surface_error(&flat, &dome(1.0, 0.0, 0.0));
        assert!((error.depth.unwrap() - 1.0).abs() < 1e-9 && error.scale == Some(0.0));
        let hollow = surface_error(&dome(-1.0, 0.0, 0.0), &dome(1.0, 0.0, 0.0));
        assert_eq!(hollow.depth, Some(1.0));
        assert_eq!(surface_error(&dome(1.0, 0.0, 0.0), &flat).depth, None);
    }

    #[test]
    fn detail_is_what_is_fine_and_its_sign_counts() {
        // The dome's own bend is .4 px of what is fine here, waves of .02 are 1.4 px.
        let truth = dome(1.0, 0.0, 0.02);
        assert!(surface_error(&dome(0.8, 0.0, 0.02), &truth).detail.unwrap() > 0.99);
        let turned_round = surface_error(&dome(1.0, 0.0, -0.02), &truth);
        assert!(turned_round.detail.unwrap() < -0.8, "{turned_round:?}");
        let smooth = surface_error(&dome(1.0, 0.0, 0.0), &truth).detail.unwrap();
        assert!(smooth.abs() < 0.3, "the rim alone explains little: {smooth}");
    }

    #[test]
    fn a_slope_is_no_detail_up_to_the_rim() {
        let waves = |tilt: f32| {
            Field::from_fn(SIDE, SIDE, |x, y| {
                let inside = (10..86).contains(&x) && (10..86).contains(&y) && !(40..50).contains(&x);
                let wave = 0.003 * gear_image::math::sin(0.9 * x as f32 + 0.4 * y as f32);
                if inside { wave + tilt * x as f32 } else { f32::NAN }
            })
        };
        let error = surface_error(&waves(0.02), &waves(0.0));
        assert!(error.detail.unwrap() > 0.97, "{error:?}");
    }

    #[test]
    fn silhouettes_are_compared_and_the_rest_only_where_both_are() {
        let half = Field::from_fn(
            SIDE,
            SIDE,
            |x, y| if x < 48 { dome(1.0, 0.0, 0.0).at(x, y) } else { f32::NAN },
        );
        let error = surface_error(&half, &dome(1.0, 0.0, 0.0));
        assert!((error.silhouette.unwrap() - 0.5).abs() < 0.01 && error.depth.unwrap() < 1e-6);
        let nothing = Field::filled(SIDE, SIDE, f32::NAN);
        let error = surface_error(&nothing, &dome(1.0, 0.0, 0.0));
        assert_eq!((error.depth, error.detail, error.silhouette), (None, None, Some(0.0)));
        assert_eq!(surface_error(&nothing, &nothing).silhouette, None);
    }
}
