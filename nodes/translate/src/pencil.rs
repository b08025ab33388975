//! Pencil: soft lines drawn along the contours, over graphite at 45° that is denser where the painting is darker.

use gear_image::filter::gaussian;
use gear_image::{Field, SrgbImage};

use crate::length;
use crate::lines::{Directions, LineSettings, grain, integrate, soft_lines, tone};

pub(crate) fn sketch(painting: &SrgbImage, seed: u64) -> Field {
    let side = painting.longer_side();
    let (width, height) = painting.size();
    let tone = tone(painting);
    let tangents = Directions::tangents(&gaussian(&tone, length(1.0, side)), length(3.0, side));
    let settings = LineSettings {
        sigma: length(0.9, side),
        sharpness: 18.0,
        threshold: 0.55,
        slope: 4.0,
    };
    let lines = integrate(
        &soft_lines(&tone, settings),
        &tangents,
        length(3.0, side).round() as usize,
    );
    let diagonal = Directions::constant(width, height, 1.0, -1.0);
    let strokes = integrate(
        &grain(width, height, seed),
        &diagonal,
        length(9.0, side).round() as usize,
    );
    let smooth = gaussian(&tone, length(2.0, side));
    let data = (0..tone.len())
        .map(|p| {
            let stroke = ((strokes.data()[p] - 0.5) * 6.0 + 0.5).clamp(0.0, 1.0);
            let dark = 1.0 - (smooth.data()[p] * 1.25).clamp(0.0, 1.0);
            let graphite = 1.0 - 0.55 * dark * (0.35 + 0.65 * (1.0 - stroke));
            (lines.data()[p].clamp(0.0, 1.0) * graphite).clamp(0.0, 1.0) * 0.97
        })
        .collect();
    Field::from_vec(width, height, data)
}
