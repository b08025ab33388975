//! The base: the body a silhouette suggests.
//!
//! *Figure.* `−Δu = 4` on the mask, `u = 0` outside it, open at the picture's frame, and `h = inflate·√u`. On a disc
//! `u = ρ² − r²`, so h is the exact hemisphere; on a strip it is a cylinder's profile. Nothing of the picture is looked
//! at: lines are [creases](crate::crease), detail on the body that leaves its shape at large alone. (Lines that absorbed
//! `u` bent the body, and where ornament passed for lines they flattened it.)
//!
//! *Relief.* A whole canvas has no silhouette. Contours of every kind absorb, `1/ℓ²` bounds the height by 2ℓ, the
//! source follows the density of contours (figures rather than sky), and a ramp makes the lower part of the
//! picture nearer: `−Δu + (κE² + 1/ℓ²) u = 4F`, `h = 1.2 √u + ramp·y`.
//!
//! Absorptions are given for a picture whose longer side is 1 and divided by the side squared, so a surface does
//! not depend on the resolution.

use gear_image::edges::soft_edges;
use gear_image::filter::gaussian;
use gear_image::solve::{Coefficients, GridSystem, Outside, SolveOptions};
use gear_image::{Field, LinearImage, Mask, stats};

use crate::fields::map;

/// How the body is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseSettings {
    /// Depth of the inflated silhouette relative to a circular profile. Few bodies are as deep as they are wide: at .8
    /// the normals of figures, carved panels and vessels of the benchmark all are nearer to the truth than at 1 (by
    /// 2.5°, 3.8° and .4°); less would cost the vessels.
    pub inflate: f32,
    /// Relief mode: height gained from the upper to the lower rim, as a share of the picture's height.
    pub ramp: f32,
}

impl Default for BaseSettings {
    fn default() -> Self {
        Self {
            inflate: 0.8,
            ramp: 0.15,
        }
    }
}

impl BaseSettings {
    /// The same with circular profiles: what light is fitted on and networks were trained with.
    pub fn round(self) -> Self {
        Self { inflate: 1.0, ..self }
    }
}

/// Absorption of a full contour in relief mode, for a longer side of 1.
const CONTOUR_ABSORPTION: f32 = 4400.0;
/// ℓ of relief mode, as a share of the longer side.
const RELIEF_LENGTH: f32 = 0.10;

/// The body of a picture, in pixels: the relief of the canvas for a full mask, else the inflated silhouette.
pub fn body(image: &LinearImage, mask: &Mask, settings: &BaseSettings) -> Field {
    if mask.is_full() {
        relief(image, settings)
    } else {
        inflated(mask, settings)
    }
}

/// The inflated silhouette, in pixels; 0 outside the mask.
pub fn inflated(mask: &Mask, settings: &BaseSettings) -> Field {
    let system = GridSystem::new(
        mask,
        &Coefficients {
            outside: Outside::Zero,
            ..Default::default()
        },
    );
    let solution = system.solve(&vec![4.0; mask.len()], None, SolveOptions::default());
    let u = solution.to_field(mask.width(), mask.height());
    map(&u, |u| settings.inflate * u.max(0.0).sqrt())
}

/// The height of a whole canvas, in pixels.
pub fn relief(image: &LinearImage, settings: &BaseSettings) -> Field {
    let (width, height) = image.size();
    let side = image.longer_side() as f32;
    // The scale grows with the picture: relief is about figures, not about brush strokes.
    let contours = soft_edges(image, f64::from(side / 192.0).max(1.0), 0.98);
    let density = gaussian(&contours, f64::from(0.04 * side));
    let low = stats::quantile(density.data(), 0.05).unwrap_or(0.0);
    let high = stats::quantile(density.data(), 0.95).unwrap_or(0.0);
    let source: Vec<f64> = density
        .data()
        .iter()
        .map(|d| 4.0 * (0.1 + 0.9 * f64::from(((d - low) / (high - low).max(1e-6)).clamp(0.0, 1.0))))
        .collect();
    let per_pixel = 1.0 / (side * side);
    let absorption = map(&contours, |e| {
        (CONTOUR_ABSORPTION * e * e + 1.0 / (RELIEF_LENGTH * RELIEF_LENGTH)) * per_pixel
    });
    let canvas = Mask::filled(width, height, true);
    let coefficients = Coefficients {
        absorption: Some(&absorption),
        ..Default::default()
    };
    let solution = GridSystem::new(&canvas, &coefficients).solve(&source, None, SolveOptions::default());
    Field::from_fn(width, height, |x, y| {
        let u = solution.values[y * width + x].max(0.0) as f32;
        1.2 * u.sqrt() + settings.ramp * y as f32
    })
}
