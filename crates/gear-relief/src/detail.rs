//! Detail: what the shading says beyond the base, and nothing else.
//!
//! The residual `(S − a)/g − n_b·l` is freed of its masked Gaussian mean, then turned into height by alternating
//! two steps: every normal moves along the light's tangent until it meets its shading (Newton length, soft
//! dead zone `r³/(r² + τ²)`), and what the slopes differ by from the base's is integrated to a height d on it,
//!
//! ```text
//! (hold − Δ) d = −div(p − p_b, q − q_b)
//! ```
//!
//! One operator serves all iterations. Slopes are clipped, so |d| ≤ C·slope/√hold whatever the shading, and shading
//! that the base explains gives d = 0. The alternation is not run to convergence: truth error is flat from 10 to 40
//! iterations, early stopping regularises.
//!
//! *Detail owns no low frequency.* The body comes from the silhouette alone: a wrong light, or a posterised tone,
//! is smooth over large distances and would bend it. So d is itself freed of its masked Gaussian mean.
//!
//! *Trust is a share of the result*, not of each step: shading believed by half adds half its detail.

use gear_image::filter::{dilate_field, gradient};
use gear_image::solve::{Coefficients, GridSystem, SolveOptions};
use gear_image::{Field, Mask};

use crate::fields::{dot, eroded, masked, normals, weighted_gaussian, zip};
use crate::light::{Calibration, LEAST_TRUST, LightFit, base_normals};
use crate::shading::Shading;

/// How detail is drawn from shading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetailSettings {
    /// Alternations; 0 leaves the base.
    pub iterations: usize,
    /// Share of the Newton step taken.
    pub step: f32,
    /// Largest structure of the shading, as a share of the square root of the mask's area.
    pub scale: f32,
    /// Length over which the height is held to the base, as a share of the longer side.
    pub hold: f32,
    /// Steepest slope.
    pub slope: f32,
    /// Residual of `n·l` below which shading says nothing, beside what noise demands.
    pub dead_zone: f32,
    /// Width of the band inside the silhouette without detail, as a share of the longer side; at least 3 px. The
    /// drawn outline darkens it, which shading would take for a slope.
    pub rim: f32,
}

impl Default for DetailSettings {
    fn default() -> Self {
        Self {
            iterations: 10,
            step: 0.8,
            scale: 0.09,
            hold: 0.08,
            slope: 4.0,
            dead_zone: 0.05,
            rim: 0.045,
        }
    }
}

/// The detail height in pixels, to be added to `base`; 0 outside the mask. `None` when there is nothing to solve for:
/// the light is not trusted, or the base explains the shading as well as a painter's tones let one tell.
pub fn detail(
    shading: &Shading,
    base: &Field,
    ink: &Field,
    mask: &Mask,
    light: &LightFit,
    calibration: &Calibration,
    settings: &DetailSettings,
) -> Option<Field> {
    let (width, height) = mask.size();
    if light.trust < LEAST_TRUST || settings.iterations == 0 || mask.count() == 0 {
        return None;
    }
    let lines = dilate_field(ink, 1);
    let area = (mask.count() as f32).sqrt();
    let rim = (settings.rim * mask.longer_side() as f32)
        .min(0.07 * area)
        .round()
        .max(3.0);
    let mut inner = eroded(mask, rim as u32);
    for (inner, &ink) in inner.data_mut().iter_mut().zip(lines.data()) {
        *inner &= ink < 0.5;
    }
    let inner_weight = inner.to_field();
    let l = light.direction;
    let base_normals = base_normals(base, mask);
    let large = f64::from(settings.scale) * (mask.count() as f64).sqrt();
    let large = large.max(4.0);

    let expected = Field::from_vec(width, height, base_normals.iter().map(|&n| dot(n, l)).collect());
    let residual = zip(&shading.shading, &expected, |s, e| {
        ((s - light.ambient) / light.gain.max(1e-6) - e).clamp(-1.0, 1.0)
    });
    let mean = weighted_gaussian(&residual, &inner_weight, large);
    let target = Field::from_vec(
        width,
        height,
        (0..mask.len())
            .map(|p| {
                let detail = if inner.data()[p] {
                    residual.data()[p] - mean.data()[p]
                } else {
                    0.0
                };
                expected.data()[p] + detail
            })
            .collect(),
    );

    let trust = light.trust * visibility(&target, &expected, &inner, light.gain, calibration.visible);
    if trust < LEAST_TRUST {
        return None;
    }

    let side = mask.longer_side() as f32;
    let hold = 1.0 / (settings.hold * side * settings.hold * side);
    let system = GridSystem::new(
        mask,
        &Coefficients {
            screening: hold,
            ..Default::default()
        },
    );
    let uncertain = calibration.core * shading.noise + calibration.tone;
    let dead_zone = uncertain / light.gain.max(1e-6) + settings.dead_zone;
    let limit = settings.slope;
    let (base_x, base_y) = gradient(base);
    let mut current: Option<Vec<f64>> = None;
    let mut raised = base.clone();
    let mut n = base_normals;
    for _ in 0..settings.iterations {
        let mut more_x = Field::filled(width, height, 0.0);
        let mut more_y = Field::filled(width, height, 0.0);
        for p in (0..mask.len()).filter(|&p| inner.data()[p]) {
            let c = dot(n[p], l);
            let r = target.data()[p] - c;
            let r = (r * r * r / (r * r + dead_zone * dead_zone)).clamp(-0.7, 0.7);
            let step = settings.step * r / (1.0 - c * c).max(0.2);
            let turned: [f32; 3] = std::array::from_fn(|i| n[p][i] + step * (l[i] - c * n[p][i]));
            let z = turned[2].max(1e-2);
            more_x.data_mut()[p] = (-turned[0] / z).clamp(-limit, limit) - base_x.data()[p].clamp(-limit, limit);
            more_y.data_mut()[p] = (-turned[1] / z).clamp(-limit, limit) - base_y.data()[p].clamp(-limit, limit);
        }
        let rhs = system.divergence_of_pixels(&more_x, &more_y);
        let options = SolveOptions {
            tolerance: 1e-4,
            max_iterations: 30,
        };
        let solution = system.solve(&rhs, current.as_deref(), options);
        raised = zip(base, &solution.to_field(width, height), |b, d| b + d);
        n = normals(&raised);
        current = Some(solution.values);
    }
    let difference = zip(&raised, base, |h, b| h - b);
    let mean = weighted_gaussian(&difference, &mask.to_field(), large);
    Some(masked(&zip(&difference, &mean, |d, m| trust * (d - m)), mask))
}

/// How clearly the shading shows more than the base explains: 0 where the RMS of what is left over, in units of
/// shading, is at most `visible`, 1 from half as much again.
fn visibility(target: &Field, expected: &Field, inner: &Mask, gain: f32, visible: f32) -> f32 {
    let (mut square, mut count) = (0.0f64, 0u32);
    for ((t, e), _) in target
        .data()
        .iter()
        .zip(expected.data())
        .zip(inner.data())
        .filter(|(_, i)| **i)
    {
        let left = f64::from(t - e);
        square += left * left;
        count += 1;
    }
    let rms = gain * (square / f64::from(count.max(1))).sqrt() as f32;
    if visible > 0.0 {
        (2.0 * (rms / visible - 1.0)).clamp(0.0, 1.0)
    } else {
        1.0
    }
}
