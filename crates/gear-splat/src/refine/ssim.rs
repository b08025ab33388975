//! Structural similarity (Wang 2004) of a rectangle of three channels, and its gradient.
//!
//! With K a normalised Gaussian window of 11 × 11, σ = 1.5 (zeros beyond the rim, as in 3DGS), μ = K∗x, σ² = K∗x² − μ²,
//! σ_xy = K∗xy − μ_x μ_y:
//!
//! S = (2 μ_x μ_y + C₁)(2 σ_xy + C₂) / ((μ_x² + μ_y² + C₁)(σ_x² + σ_y² + C₂)).
//!
//! S is a function of the three blurred maps of x, and K is symmetric, so the gradient of Σ v S by x is three more blurs:
//! K∗(v ∂S/∂μ) + 2x · K∗(v ∂S/∂(K∗x²)) + y · K∗(v ∂S/∂(K∗xy)).
//!
//! So there are two sweeps over the rows. The first blurs x, x² and xy and turns them into the derivatives of S, the
//! second blurs those and adds up the gradient. A sweep keeps a ring of the last eleven rows, blurred along themselves; a
//! row is finished when the ring is centred on it, while everything is still in the second-level cache. Bands of rows
//! are swept by different threads, and every row comes out the same wherever a band begins. Rows are padded to whole
//! registers; what lies beyond the rim is zero.

use std::ops::Range;

use rayon::prelude::*;

use crate::cpu::SimdLevel;
use crate::cpu::simd::simd_kernels;

const C1: f32 = 1e-4;
const C2: f32 = 9e-4;
const RADIUS: usize = 5;
/// Side of the window.
const WINDOW: usize = 2 * RADIUS + 1;
const SIGMA: f64 = 1.5;
/// Zeros at either end of a row that is to be blurred.
const PAD: usize = 8;
/// Rows are padded to a multiple of this.
const LANES: usize = 16;
/// Rows of a band.
const BAND: usize = 64;

/// Distance between rows of so many pixels.
pub(super) fn pitch(width: usize) -> usize {
    width.next_multiple_of(LANES)
}

/// Half of the window, from the middle on; narrower windows end in zeros.
type Taps = [f32; RADIUS + 1];

/// The window, narrower where a picture is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    taps: Taps,
    radius: usize,
}

impl Window {
    pub fn for_size(width: usize, height: usize) -> Self {
        let side = WINDOW.min(width).min(height).max(1);
        let radius = (side - 1) / 2;
        let raw: [f64; RADIUS + 1] = std::array::from_fn(|d| {
            let sigmas = d as f64 / SIGMA;
            if d > radius {
                0.0
            } else {
                libm::exp(-0.5 * sigmas * sigmas)
            }
        });
        let total = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
        Self {
            taps: raw.map(|w| (w / total) as f32),
            radius,
        }
    }

    pub fn radius(&self) -> usize {
        self.radius
    }
}

/// One channel of a target: its colours y, K∗y and K∗y², row by row at [`pitch`].
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    pub y: Vec<f32>,
    mean: Vec<f32>,
    square: Vec<f32>,
}

impl Fixed {
    /// `y` has rows of `width` pixels at their [`pitch`], and zeros between.
    pub fn new(y: Vec<f32>, width: usize, window: &Window) -> Self {
        let [mean, square] = moments(&y, width, window);
        Self { y, mean, square }
    }
}

/// K∗y and K∗y².
pub(super) fn moments(y: &[f32], width: usize, window: &Window) -> [Vec<f32>; 2] {
    let (mut mean, mut square) = (vec![0.0; y.len()], vec![0.0; y.len()]);
    let band = BAND * pitch(width);
    let parts = mean.par_chunks_mut(band).zip(square.par_chunks_mut(band)).enumerate();
    parts.for_each(|(k, (mean, square))| {
        blur_band(
            SimdLevel::current(),
            window.taps,
            y,
            pitch(width),
            k * BAND,
            mean,
            square,
        );
    });
    [mean, square]
}

/// The two denominators of S, μ_x² + μ_y² + C₁ and σ_x² + σ_y² + C₂, of one channel at every pixel.
pub(super) fn denominators(compared: &Compared, channel: usize) -> [Vec<f32>; 2] {
    let [_, _, width, height] = compared.rect;
    let mut x = vec![0.0; pitch(width) * height];
    for (y, row) in x.chunks_exact_mut(pitch(width)).enumerate() {
        row.iter_mut()
            .zip(compared.row(y))
            .for_each(|(x, pixel)| *x = pixel[channel]);
    }
    let fixed = &compared.fixed[channel];
    let [mut mean, mut square] = moments(&x, width, &compared.window);
    for i in 0..x.len() {
        let (xx, yy) = (mean[i] * mean[i], fixed.mean[i] * fixed.mean[i]);
        mean[i] = xx + yy + C1;
        square[i] = (square[i] - xx).max(0.0) + (fixed.square[i] - yy).max(0.0) + C2;
    }
    [mean, square]
}

/// What is compared: a rectangle of a picture with the target.
#[derive(Clone, Copy)]
pub(super) struct Compared<'a> {
    /// The picture.
    pub rgb: &'a [[f32; 3]],
    /// Its width, pixels.
    pub columns: usize,
    /// Left, top, width and height of the rectangle.
    pub rect: [usize; 4],
    /// The target's channels in the rectangle.
    pub fixed: &'a [Fixed; 3],
    /// Weights of its pixels, at [`pitch`].
    pub weights: &'a [f32],
    pub window: Window,
}

impl<'a> Compared<'a> {
    fn pitch(&self) -> usize {
        pitch(self.rect[2])
    }

    fn height(&self) -> usize {
        self.rect[3]
    }

    /// The pixels of row `y` of the rectangle.
    #[inline(always)]
    pub fn row(&self, y: usize) -> &'a [[f32; 3]] {
        let [left, top, width, _] = self.rect;
        &self.rgb[(top + y) * self.columns + left..][..width]
    }

    /// The first `rect[2]` entries of row `y` of a plane.
    #[inline(always)]
    pub fn plane_row<'b>(&self, plane: &'b [f32], y: usize) -> &'b [f32] {
        &plane[y * self.pitch()..][..self.rect[2]]
    }
}

/// Room for the derivatives of S: three of each channel for every row of the largest rectangle so far.
#[derive(Default)]
pub(super) struct Scratch(Vec<f32>);

/// Blurred maps of a channel, and derivatives by them.
const MAPS: usize = 3;

/// Σ_pixels w (1 − S), summed over the channels.
pub(super) fn dissimilarity(compared: &Compared) -> f64 {
    let bands: Vec<Vec<f64>> = bands(compared.height())
        .into_par_iter()
        .map(|rows| {
            let mut sums = vec![0.0; rows.len()];
            sum_band(SimdLevel::current(), compared, rows, &mut sums);
            sums
        })
        .collect();
    bands.iter().flatten().sum()
}

/// Adds `factor` · ∂(Σ w S)/∂x, by pixel and channel, to what `start` makes of each row; with the factor 0 it does no
/// more than that.
///
/// `out` is the picture's gradient, of the size of the picture; only the rectangle is written.
pub(super) fn gradient(
    compared: &Compared,
    factor: f32,
    scratch: &mut Scratch,
    out: &mut [[f32; 3]],
    start: impl Fn(usize, &mut [[f32; 3]]) + Sync,
) {
    let level = SimdLevel::current();
    let [left, top, width, height] = compared.rect;
    let row = 3 * MAPS * pitch(width);
    if factor != 0.0 {
        let len = scratch.0.len().max(row * height);
        scratch.0.resize(len, 0.0);
        scratch.0[..row * height]
            .par_chunks_mut(BAND * row)
            .zip(bands(height))
            .for_each(|(out, rows)| differentiate_band(level, compared, factor, rows, out));
    }
    let derivatives = &scratch.0;
    out.par_chunks_mut(compared.columns * BAND)
        .enumerate()
        .for_each(|(k, band)| {
            let begin = (k * BAND).max(top);
            let end = (k * BAND + band.len() / compared.columns).min(top + height);
            if begin >= end {
                return;
            }
            let first = begin - k * BAND;
            let mut rows: Vec<&mut [[f32; 3]]> = band
                .chunks_exact_mut(compared.columns)
                .skip(first)
                .take(end - begin)
                .map(|row| &mut row[left..left + width])
                .collect();
            for (y, row) in rows.iter_mut().enumerate() {
                start(begin - top + y, row);
            }
            if factor != 0.0 {
                add_band(level, compared, derivatives, begin - top..end - top, &mut rows);
            }
        });
}

/// The rows of a picture in bands.
fn bands(height: usize) -> Vec<Range<usize>> {
    (0..height)
        .step_by(BAND)
        .map(|first| first..height.min(first + BAND))
        .collect()
}

/// The last eleven rows of three maps, blurred along themselves.
struct Ring {
    pitch: usize,
    rows: [Vec<f32>; MAPS],
    /// The next row, between zeros.
    padded: [Vec<f32>; MAPS],
    /// The row in the middle of the ring, blurred both ways.
    blurred: [Vec<f32>; MAPS],
}

impl Ring {
    fn new(pitch: usize) -> Self {
        let vectors = |len: usize| std::array::from_fn(|_| vec![0.0; len]);
        Self {
            pitch,
            rows: vectors(WINDOW * pitch),
            padded: vectors(pitch + 2 * PAD),
            blurred: vectors(pitch),
        }
    }

    /// Blurs `rows` of maps that have `height` rows: `fill` writes the row with the given number, `done` is handed the
    /// blurred one.
    #[inline(always)]
    fn sweep(
        &mut self,
        taps: &Taps,
        rows: Range<usize>,
        height: usize,
        mut fill: impl FnMut(usize, &mut [&mut [f32]; MAPS]),
        mut done: impl FnMut(usize, &mut [Vec<f32>; MAPS]),
    ) {
        let pitch = self.pitch;
        // Row y comes in as number y + RADIUS.
        for number in rows.start..rows.end + 2 * RADIUS {
            let place = number % WINDOW * pitch;
            if number >= RADIUS && number - RADIUS < height {
                let mut parts = self.padded.each_mut().map(|row| &mut row[PAD..PAD + pitch]);
                fill(number - RADIUS, &mut parts);
                for (padded, out) in self.padded.iter().zip(&mut self.rows) {
                    along(taps, padded, &mut out[place..place + pitch]);
                }
            } else {
                for out in &mut self.rows {
                    out[place..place + pitch].fill(0.0);
                }
            }
            if number >= rows.start + 2 * RADIUS {
                let row = number - 2 * RADIUS;
                for (ring, out) in self.rows.iter().zip(&mut self.blurred) {
                    across(taps, ring, row, out);
                }
                done(row, &mut self.blurred);
            }
        }
    }
}

/// Σ_k taps[|k|] · row k, of eleven equally long rows.
#[inline(always)]
fn weigh(taps: &Taps, rows: [&[f32]; WINDOW], out: &mut [f32]) {
    for i in 0..out.len() {
        let pair = |k: usize| taps[k] * (rows[RADIUS - k][i] + rows[RADIUS + k][i]);
        out[i] = (taps[0] * rows[RADIUS][i] + pair(1)) + (pair(2) + pair(3)) + (pair(4) + pair(5));
    }
}

#[inline(always)]
fn along(taps: &Taps, padded: &[f32], out: &mut [f32]) {
    let len = out.len();
    weigh(taps, std::array::from_fn(|k| &padded[PAD - RADIUS + k..][..len]), out);
}

#[inline(always)]
fn across(taps: &Taps, ring: &[f32], first: usize, out: &mut [f32]) {
    let len = out.len();
    weigh(
        taps,
        std::array::from_fn(|k| &ring[(first + k) % WINDOW * len..][..len]),
        out,
    );
}

/// S at a pixel, and its derivatives by the blurred maps of x.
struct Similarity {
    s: f32,
    by_mean: f32,
    by_square: f32,
    by_product: f32,
}

#[inline(always)]
fn similarity(mean_x: f32, square_x: f32, product: f32, mean_y: f32, square_y: f32) -> Similarity {
    let (xx, yy, xy) = (mean_x * mean_x, mean_y * mean_y, mean_x * mean_y);
    let a1 = 2.0 * xy + C1;
    let a2 = 2.0 * (product - xy) + C2;
    let b1 = xx + yy + C1;
    let b2 = (square_x - xx) + (square_y - yy) + C2;
    let inverse = 1.0 / (b1 * b2);
    let s = a1 * a2 * inverse;
    let by_product = 2.0 * a1 * inverse;
    let by_square = -s * (b1 * inverse);
    let direct = 2.0 * mean_y * a2 * inverse - 2.0 * mean_x * s * (b2 * inverse);
    Similarity {
        s,
        by_mean: direct - mean_y * by_product - 2.0 * mean_x * by_square,
        by_square,
        by_product,
    }
}

/// x, x² and xy of one channel of a row.
#[inline(always)]
fn products(pixels: &[[f32; 3]], channel: usize, y: &[f32], [x, xx, xy]: &mut [&mut [f32]; MAPS]) {
    let len = pixels.len();
    let (x, xx, xy, y) = (&mut x[..len], &mut xx[..len], &mut xy[..len], &y[..len]);
    for i in 0..len {
        let value = pixels[i][channel];
        x[i] = value;
        xx[i] = value * value;
        xy[i] = value * y[i];
    }
}

/// Replaces the blurred maps of a row by `factor` · v times the derivatives of S by them.
#[inline(always)]
fn differentiate(
    factor: f32,
    [mean, square, product]: &mut [Vec<f32>; MAPS],
    mean_y: &[f32],
    square_y: &[f32],
    v: &[f32],
    [by_mean, by_square, by_product]: [&mut [f32]; MAPS],
) {
    let len = by_mean.len();
    let (mean, square, product) = (&mean[..len], &square[..len], &product[..len]);
    let (mean_y, square_y, v) = (&mean_y[..len], &square_y[..len], &v[..len]);
    let (by_square, by_product) = (&mut by_square[..len], &mut by_product[..len]);
    for i in 0..len {
        let d = similarity(mean[i], square[i], product[i], mean_y[i], square_y[i]);
        let weight = factor * v[i];
        by_mean[i] = weight * d.by_mean;
        by_square[i] = weight * d.by_square;
        by_product[i] = weight * d.by_product;
    }
}

/// Σ v (1 − S) of a row, in lanes of a fixed number.
#[inline(always)]
fn sum_row([mean, square, product]: &mut [Vec<f32>; MAPS], mean_y: &[f32], square_y: &[f32], v: &[f32]) -> f64 {
    let len = mean.len();
    let (square, product) = (&square[..len], &mut product[..len]);
    let (mean_y, square_y, v) = (&mean_y[..len], &square_y[..len], &v[..len]);
    for i in 0..len {
        let s = similarity(mean[i], square[i], product[i], mean_y[i], square_y[i]).s;
        product[i] = v[i] * (1.0 - s);
    }
    let mut lanes = [0.0f64; LANES];
    for part in product.chunks_exact(LANES) {
        for (lane, x) in lanes.iter_mut().zip(part) {
            *lane += f64::from(*x);
        }
    }
    lanes.iter().sum()
}

simd_kernels! {
    /// K∗y and K∗y² of the rows from `first` on.
    fn blur_band(taps: Taps, y: &[f32], pitch: usize, first: usize, mean: &mut [f32], square: &mut [f32]) {
        let rows = first..first + mean.len() / pitch;
        Ring::new(pitch).sweep(
            &taps,
            rows,
            y.len() / pitch,
            |row, [plain, squared, _]| {
                for (i, &y) in y[row * pitch..][..pitch].iter().enumerate() {
                    plain[i] = y;
                    squared[i] = y * y;
                }
            },
            |row, [plain, squared, _]| {
                let at = (row - first) * pitch;
                mean[at..at + pitch].copy_from_slice(plain);
                square[at..at + pitch].copy_from_slice(squared);
            },
        );
    }

    /// Σ v (1 − S) of each of the rows, added to `sums`.
    fn sum_band(compared: &Compared, rows: Range<usize>, sums: &mut [f64]) {
        let (pitch, first) = (compared.pitch(), rows.start);
        let mut ring = Ring::new(pitch);
        for (c, fixed) in compared.fixed.iter().enumerate() {
            ring.sweep(
                &compared.window.taps,
                rows.clone(),
                compared.height(),
                |y, parts| products(compared.row(y), c, compared.plane_row(&fixed.y, y), parts),
                |y, blurred| {
                    let at = y * pitch..(y + 1) * pitch;
                    let (mean, square) = (&fixed.mean[at.clone()], &fixed.square[at.clone()]);
                    sums[y - first] += sum_row(blurred, mean, square, &compared.weights[at]);
                },
            );
        }
    }

    /// `factor` · v times the derivatives of S by the three maps, for each channel of each row.
    fn differentiate_band(compared: &Compared, factor: f32, rows: Range<usize>, out: &mut [f32]) {
        let (pitch, first) = (compared.pitch(), rows.start);
        let mut ring = Ring::new(pitch);
        for (c, fixed) in compared.fixed.iter().enumerate() {
            ring.sweep(
                &compared.window.taps,
                rows.clone(),
                compared.height(),
                |y, parts| products(compared.row(y), c, compared.plane_row(&fixed.y, y), parts),
                |y, blurred| {
                    let at = y * pitch..(y + 1) * pitch;
                    let (mean, square) = (&fixed.mean[at.clone()], &fixed.square[at.clone()]);
                    let place = ((y - first) * 3 + c) * MAPS * pitch;
                    let (by_mean, rest) = out[place..place + MAPS * pitch].split_at_mut(pitch);
                    let (by_square, by_product) = rest.split_at_mut(pitch);
                    let parts = [by_mean, by_square, by_product];
                    differentiate(factor, blurred, mean, square, &compared.weights[at], parts);
                },
            );
        }
    }

    /// Blurs the derivatives and adds the gradient of `rows` to `out`.
    fn add_band(compared: &Compared, derivatives: &[f32], rows: Range<usize>, out: &mut [&mut [[f32; 3]]]) {
        let (pitch, first) = (compared.pitch(), rows.start);
        let mut ring = Ring::new(pitch);
        for (c, fixed) in compared.fixed.iter().enumerate() {
            ring.sweep(
                &compared.window.taps,
                rows.clone(),
                compared.height(),
                |y, parts| {
                    for (m, part) in parts.iter_mut().enumerate() {
                        let place = ((y * 3 + c) * MAPS + m) * pitch;
                        part.copy_from_slice(&derivatives[place..place + pitch]);
                    }
                },
                |y, [mean, square, product]| {
                    let (x, target) = (compared.row(y), compared.plane_row(&fixed.y, y));
                    let len = x.len();
                    let (mean, square, product) = (&mean[..len], &square[..len], &product[..len]);
                    for (i, out) in out[y - first][..len].iter_mut().enumerate() {
                        out[c] += mean[i] + 2.0 * x[i][c] * square[i] + target[i] * product[i];
                    }
                },
            );
        }
    }
}

#[cfg(test)]
mod tests;
