//! NIQE: how far a picture's local statistics lie from those of pristine photographs; lower is more natural.
//!
//! Mittal, Soundararajan, Bovik, "Making a 'completely blind' image quality analyzer", 2013, as their MATLAB
//! release and BasicSR's `calculate_niqe` compute it. In order:
//!
//! 1. `luma`: 8-bit codes, then MATLAB's Y of YCbCr (16..235), rounded to integers.
//! 2. Crop to whole blocks of 96 × 96 pixels, from the top left corner.
//! 3. `mscn`: subtract the local mean, divide by the local deviation + 1.
//! 4. `aggd`: 18 features a block: the shape and spread of the coefficients, and of their products with
//!    four neighbours.
//! 5. The same on the luma halved by MATLAB's antialiased bicubic (`half`), blocks of 48: 36 features in all.
//! 6. `pristine::distance`: a Mahalanobis distance between the picture's blocks and the pristine model.
//!
//! The last digits of the reference are not defined where a picture is flat: a constant neighbourhood's
//! coefficient is rounding noise there, and its *sign* decides which spread it dilutes. We take differences
//! from the centre pixel before weighting, so that it is exactly zero; BasicSR gets the same zero from storing
//! the mean in f32.

mod aggd;
mod half;
mod luma;
mod mscn;
mod pristine;

use gear_image::SrgbImage;
use rayon::prelude::*;

use self::aggd::Grid;
use self::luma::Plane;

/// Side of a block at full scale, in pixels.
const BLOCK: usize = 96;
/// Features of a block at one scale.
const PER_SCALE: usize = aggd::FEATURES;
/// Features of a block.
const FEATURES: usize = 2 * PER_SCALE;

/// NIQE of a picture, or `None` where it is undefined: fewer than two blocks of 96 × 96 with any variation.
pub fn niqe(picture: &SrgbImage) -> Option<f64> {
    niqe_of_luma(luma::luma(picture), Grid::reference())
}

/// The reference's step of the grid of shapes.
pub const SHAPE_STEP: f64 = aggd::STEP;

/// The same with shapes looked up on a grid of another step than [`SHAPE_STEP`], above 0 and at most 9.8; and how many shapes
/// that grid has. For the curve of error over its size.
pub fn niqe_with_step(picture: &SrgbImage, step: f64) -> (Option<f64>, usize) {
    let grid = Grid::of_step(step);
    (niqe_of_luma(luma::luma(picture), &grid), grid.len())
}

fn niqe_of_luma(luma: Plane, grid: &Grid) -> Option<f64> {
    let (columns, rows) = (luma.width / BLOCK, luma.height / BLOCK);
    if columns * rows < 2 {
        return None;
    }
    let full = luma.cropped(columns * BLOCK, rows * BLOCK);
    let halved = half::half(&full);
    let full = mscn::mscn(&full);
    let halved = mscn::mscn(&halved);
    let blocks: Vec<[f64; FEATURES]> = (0..columns * rows)
        .into_par_iter()
        .map(|i| {
            let (bx, by) = (i % columns, i / columns);
            let mut features = [0.0; FEATURES];
            let (first, second) = features.split_at_mut(PER_SCALE);
            let at = (bx * BLOCK, by * BLOCK);
            first.copy_from_slice(&aggd::features(&full, at, BLOCK, grid));
            let at = (bx * BLOCK / 2, by * BLOCK / 2);
            second.copy_from_slice(&aggd::features(&halved, at, BLOCK / 2, grid));
            features
        })
        .collect();
    let (mean, covariance) = moments(&blocks)?;
    pristine::distance(&mean, &covariance)
}

/// Mean and covariance (divisor n − 1) of the blocks' features.
///
/// As in the reference, a feature's mean skips only its own NaNs, the covariance only whole blocks without any:
/// a flat block, whose spreads are undefined, still counts with the first shape of the grid.
fn moments(blocks: &[[f64; FEATURES]]) -> Option<([f64; FEATURES], Vec<[f64; FEATURES]>)> {
    let mut mean = [0.0; FEATURES];
    for (f, mean) in mean.iter_mut().enumerate() {
        let values = blocks.iter().map(|b| b[f]).filter(|v| !v.is_nan());
        let (mut sum, mut count) = (0.0, 0.0);
        for value in values {
            sum += value;
            count += 1.0;
        }
        *mean = sum / count;
    }
    let whole: Vec<_> = blocks.iter().filter(|b| b.iter().all(|v| !v.is_nan())).collect();
    if whole.len() < 2 {
        return None;
    }
    let n = whole.len() as f64;
    let mut centre = [0.0; FEATURES];
    for (f, centre) in centre.iter_mut().enumerate() {
        *centre = whole.iter().map(|b| b[f]).fold(0.0, |sum, v| sum + v) / n;
    }
    let mut covariance = vec![[0.0; FEATURES]; FEATURES];
    for i in 0..FEATURES {
        for j in 0..=i {
            let sum = whole
                .iter()
                .fold(0.0, |sum, b| sum + (b[i] - centre[i]) * (b[j] - centre[j]));
            covariance[i][j] = sum / (n - 1.0);
            covariance[j][i] = covariance[i][j];
        }
    }
    Some((mean, covariance))
}

#[cfg(test)]
mod tests;
