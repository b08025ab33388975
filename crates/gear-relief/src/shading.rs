//! Shading: what is left of the luminance when reflectance edges are taken out (colour Retinex).
//!
//! Every link between pixels gets a weight `w = exp(−(Δchroma/c)² − (Δlog/t)⁴)·(1 − ink)`: chromaticity changes, tone
//! steps and drawn lines are paint, smooth changes of luminance alone are light. The log shading s is what explains the
//! gradients of `ℓ = log(G₁∗L + 10⁻³)` where they are light and is as even as it can where they are paint,
//!
//! ```text
//! Σ w (Δs − Δℓ)² + ε (Δs)²  →  min
//! ```
//!
//! on the mask (natural sides, a trace of absorption); it is centred on its median, smoothed and exponentiated. With
//! ε → ∞ in place of a small one, gradients of paint would count as level ground: a pattern then hides the light that
//! falls on it, as it did (correlation with the true shading of photographed figures .24, with ε = .1 .30).

use gear_image::filter::{dilate_field, gaussian};
use gear_image::solve::{Coefficients, GridSystem, SolveOptions};
use gear_image::{Field, LinearImage, Mask, math, stats};

use crate::fields::{eroded, inside, map, weighted_gaussian, zip};
use crate::ink::chromaticity;

/// Where paint ends and light begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingSettings {
    /// Step of chromaticity per pixel that counts as paint.
    pub chroma_step: f32,
    /// Step of log luminance per pixel that counts as paint.
    pub log_step: f32,
    /// ε, how much a link counts whose gradient is paint.
    pub level: f32,
    /// Smoothing of the shading, as a share of the longer side; at least 2 px.
    pub smooth: f32,
}

impl Default for ShadingSettings {
    fn default() -> Self {
        Self {
            chroma_step: 0.02,
            log_step: 0.25,
            level: 0.1,
            smooth: 0.004,
        }
    }
}

/// Relative shading of a picture.
#[derive(Clone, Debug)]
pub struct Shading {
    /// Shading, median 1 inside the mask.
    pub shading: Field,
    /// Robust standard deviation of what the smoothing took away: brushwork and grain, in log units.
    pub noise: f32,
}

/// Absorption of the reintegration, for a longer side of 1: pins the mean of parts, invisible at any length.
const ABSORPTION: f32 = 0.75;

/// Splits the shading from a picture.
pub fn shading(image: &LinearImage, mask: &Mask, ink: &Field, settings: &ShadingSettings) -> Shading {
    let (width, height) = image.size();
    let log = map(&gaussian(&image.luminance(), 1.0), |l| math::ln(l.max(0.0) + 1e-3));
    let chroma = chromaticity(image, 1.0);
    let level = settings.level.max(1e-6);
    let lines = dilate_field(ink, 1);
    let keep = |p: (usize, usize), q: (usize, usize)| {
        let step = log.at(q.0, q.1) - log.at(p.0, p.1);
        let mut colour = 0.0;
        for plane in &chroma {
            let d = plane.at(q.0, q.1) - plane.at(p.0, p.1);
            colour += d * d;
        }
        let c = colour / (settings.chroma_step * settings.chroma_step);
        let t = (step / settings.log_step) * (step / settings.log_step);
        let line = lines.at(p.0, p.1).max(lines.at(q.0, q.1));
        (step, math::exp(-c - t * t) * (1.0 - line))
    };
    let zero = || Field::filled(width, height, 0.0);
    let (mut right, mut down, mut to_right, mut to_down) = (zero(), zero(), zero(), zero());
    for y in 0..height {
        for x in 0..width {
            for (gradient, link, q) in [
                (&mut right, &mut to_right, (x + 1, y)),
                (&mut down, &mut to_down, (x, y + 1)),
            ] {
                if q.0 < width && q.1 < height {
                    let (step, weight) = keep((x, y), q);
                    link.set(x, y, weight + level);
                    gradient.set(x, y, step * weight / (weight + level));
                }
            }
        }
    }
    let side = image.longer_side() as f32;
    let system = GridSystem::new(
        mask,
        &Coefficients {
            screening: ABSORPTION / (side * side),
            right: Some(&to_right),
            down: Some(&to_down),
            ..Default::default()
        },
    );
    let solution = system.solve(
        &system.divergence_of_links(&right, &down),
        None,
        SolveOptions::default(),
    );
    let log_shading = solution.to_field(width, height);
    let median = stats::median(&inside(&log_shading, mask)).unwrap_or(0.0);
    let log_shading = map(&log_shading, |s| s - median);
    let sigma = f64::from((settings.smooth * side).max(2.0));
    let low = weighted_gaussian(&log_shading, &mask.to_field(), sigma);
    let mut core = eroded(mask, 3);
    if core.count() == 0 {
        core = mask.clone();
    }
    let deviation = zip(&log_shading, &low, |s, l| (s - l).abs());
    let noise = 1.4826 * stats::median(&inside(&deviation, &core)).unwrap_or(0.0);
    let shading = Field::from_vec(
        width,
        height,
        low.data()
            .iter()
            .zip(mask.data())
            .map(|(&l, &m)| if m { math::exp(l.clamp(-3.0, 3.0)) } else { 1.0 })
            .collect(),
    );
    Shading { shading, noise }
}
