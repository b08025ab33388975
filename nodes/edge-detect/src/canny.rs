//! Canny's edge detector on the cube root of luminance, which spaces tones as the eye does.

use gear_image::filter::{Connectivity, bilinear, components, dilate_field, gaussian, gradient};
use gear_image::{Field, LinearImage, Mask, math, stats};
use rayon::prelude::*;

/// Binary contours, one pixel wide and then widened by one: 1 on a contour, else 0. Thresholds are shares of the
/// 98 % quantile of the gradient.
pub(crate) fn contours(light: &LinearImage, low: f32, high: f32, sigma: f64) -> Field {
    let (width, height) = light.size();
    let mut tone = light.luminance();
    math::map_slice(tone.data_mut(), math::cbrt_slice);
    let (gx, gy) = gradient(&gaussian(&tone, sigma));
    let strength = Field::from_vec(
        width,
        height,
        gx.data()
            .iter()
            .zip(gy.data())
            .map(|(x, y)| (x * x + y * y).sqrt())
            .collect(),
    );
    let scale = stats::quantile(strength.data(), 0.98).unwrap_or(0.0);
    // Also when almost everything is flat: then the quantile is 0 and lines are measured by the strongest.
    let scale = if scale > 1e-6 {
        scale
    } else {
        stats::range(strength.data()).map_or(0.0, |(_, high)| high)
    };
    if scale.is_nan() || scale <= 1e-6 {
        return Field::filled(width, height, 0.0);
    }
    let ridge = ridge(&strength, &gx, &gy);
    dilate_field(&hysteresis(&ridge, low.max(1e-3) * scale, high * scale).to_field(), 1)
}

/// The gradient where it is no smaller than its two neighbours along its own direction, else 0. Of two equal
/// neighbours the one behind wins, so that a plateau two pixels wide gives one line.
fn ridge(strength: &Field, gx: &Field, gy: &Field) -> Field {
    let (width, height) = strength.size();
    let mut out = Field::filled(width, height, 0.0);
    out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for x in 0..width {
            let s = strength.at(x, y);
            if s <= 0.0 {
                continue;
            }
            let (dx, dy) = (gx.at(x, y), gy.at(x, y));
            let longest = dx.abs().max(dy.abs());
            let (dx, dy) = (dx / longest, dy / longest);
            let (x0, y0) = (x as f32, y as f32);
            let ahead = bilinear(strength, x0 + dx, y0 + dy);
            let behind = bilinear(strength, x0 - dx, y0 - dy);
            if s >= ahead && s > behind {
                out[x] = s;
            }
        }
    });
    out
}

/// Ridges of at least `low` that hang together with one of at least `high`.
fn hysteresis(ridge: &Field, low: f32, high: f32) -> Mask {
    let (width, height) = ridge.size();
    let weak = Mask::from_vec(width, height, ridge.data().iter().map(|&s| s >= low).collect());
    let parts = components(&weak, Connectivity::Eight);
    let mut strong = vec![false; parts.sizes.len() + 1];
    for (&label, &s) in parts.labels.iter().zip(ridge.data()) {
        if label > 0 && s >= high {
            strong[label as usize] = true;
        }
    }
    Mask::from_vec(
        width,
        height,
        parts.labels.iter().map(|&label| strong[label as usize]).collect(),
    )
}
