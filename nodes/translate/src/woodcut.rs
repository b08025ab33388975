//! Woodcut: tone against a hatch whose phase bends with the contours, and heavy lines.

use gear_image::filter::gaussian;
use gear_image::{Field, SrgbImage, math, stats};

use crate::length;
use crate::lines::{Directions, LineSettings, integrate, soft_lines, tone};

/// Period of the hatch and its direction (cosines with x and y).
const PERIOD: f64 = 5.0;
const ACROSS: f32 = 0.564_642_5;
const DOWN: f32 = 0.825_335_6;

pub(crate) fn cut(painting: &SrgbImage) -> Field {
    let side = painting.longer_side();
    let (width, height) = painting.size();
    let tone = tone(painting);
    let smooth = gaussian(&tone, length(1.5, side));
    let tangents = Directions::tangents(&smooth, length(6.0, side));
    let low = stats::quantile(smooth.data(), 0.02).unwrap_or(0.0);
    let high = stats::quantile(smooth.data(), 0.98).unwrap_or(1.0);
    let settings = LineSettings {
        sigma: length(1.2, side),
        sharpness: 25.0,
        threshold: 0.5,
        slope: 30.0,
    };
    let lines = soft_lines(
        &integrate(&tone, &tangents, length(4.0, side).round() as usize),
        settings,
    );
    let pixel = std::f32::consts::TAU / length(PERIOD, side) as f32;
    let data = (0..tone.len())
        .map(|p| {
            let (x, y) = ((p % width) as f32, (p / width) as f32);
            let bend = 3.0 * std::f32::consts::TAU / PERIOD as f32 * tangents.cosine(p);
            let hatch = 0.5 + 0.5 * math::sin((x * ACROSS + y * DOWN) * pixel + bend);
            let t = ((smooth.data()[p] - low) / (high - low).max(1e-6)).clamp(0.0, 1.0);
            let cut = math::logistic((t - 0.15 - 0.7 * (1.0 - hatch) * (1.0 - t).sqrt()) * 25.0);
            cut.min(lines.data()[p]).clamp(0.0, 1.0)
        })
        .collect();
    Field::from_vec(width, height, data)
}
