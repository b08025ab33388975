//! Gaussian blur: separable, mirrored rim, cut at 4σ (scipy's `gaussian_filter` with `mode="reflect"`).
//!
//! Beyond [`DIRECT_SIGMA`] the kernel is so wide that the image is first averaged down by a whole factor, blurred
//! there, and brought back bilinearly. The averaging cells have a variance of (f²−1)/12 and the interpolation
//! adds about f²/6; both are taken off σ². What is left is below 1 % of the range at a step edge (tested).

use multiversion::multiversion;
use rayon::prelude::*;

use super::{reflect, resize, resize_rgb};
use crate::{Field, Rgb, Space, SrgbImage, colour};

/// Largest σ, in pixels, that is convolved at full resolution.
const DIRECT_SIGMA: f64 = 24.0;

/// Half of the normalised kernel: weights at distance 0, 1, …, r = ⌊4σ + ½⌋.
pub(crate) fn kernel(sigma: f64) -> Vec<f32> {
    let radius = (4.0 * sigma + 0.5) as usize;
    let raw: Vec<f64> = (0..=radius)
        .map(|i| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma)))
        .collect();
    let total = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
    raw.iter().map(|w| (w / total) as f32).collect()
}

const TILE: usize = 32;

/// out[i] = Σ_k w_k·(line[i + (r−k)s] + line[i + (r+k)s]), s the distance between samples of one channel.
/// `line` is `out` with r·s samples more on both sides. Accumulates a tile of outputs in registers.
#[multiversion(targets = "simd")]
pub(crate) fn convolve_line(line: &[f32], out: &mut [f32], half: &[f32], stride: usize) {
    let radius = half.len() - 1;
    let centre = radius * stride;
    let mut start = 0;
    let mut tiles = out.chunks_exact_mut(TILE);
    for tile in &mut tiles {
        let mut acc = [0.0f32; TILE];
        let middle = &line[start + centre..][..TILE];
        for i in 0..TILE {
            acc[i] = half[0] * middle[i];
        }
        for k in 1..=radius {
            let left = &line[start + centre - k * stride..][..TILE];
            let right = &line[start + centre + k * stride..][..TILE];
            for i in 0..TILE {
                acc[i] += half[k] * (left[i] + right[i]);
            }
        }
        tile.copy_from_slice(&acc);
        start += TILE;
    }
    for out in tiles.into_remainder() {
        let mut acc = half[0] * line[start + centre];
        for k in 1..=radius {
            acc += half[k] * (line[start + centre - k * stride] + line[start + centre + k * stride]);
        }
        *out = acc;
        start += 1;
    }
}

/// Output rows that the vertical pass makes together.
const BAND: usize = 32;

/// Rows first, first + 1, … of out = Σ_k w_k·(row[y−k] + row[y+k]), mirrored at the rim, as many as `out` holds.
///
/// A column of tiles, as high as the band and its margins, is copied together first: rows lie a multiple of the page
/// size apart in most pictures, and summing them in place would fight over a few lines of the cache.
#[multiversion(targets = "simd")]
fn convolve_columns(
    data: &[f32],
    stride: usize,
    height: usize,
    first: usize,
    half: &[f32],
    column: &mut Vec<f32>,
    out: &mut [f32],
) {
    let radius = half.len() - 1;
    let rows = out.len() / stride;
    column.resize((rows + 2 * radius) * TILE, 0.0);
    for x in (0..stride).step_by(TILE) {
        let n = TILE.min(stride - x);
        for (i, tile) in column.chunks_exact_mut(TILE).enumerate() {
            let y = reflect((first + i) as isize - radius as isize, height);
            let source = &data[y * stride + x..];
            if n == TILE {
                tile.copy_from_slice(&source[..TILE]); // of a length that the compiler knows
            } else {
                tile[..n].copy_from_slice(&source[..n]);
            }
        }
        // Tiles are slices, not arrays: of arrays the compiler unrolls the loops below before it vectorises them,
        // and then no longer can.
        for (y, out) in out.chunks_exact_mut(stride).enumerate() {
            let centre = (y + radius) * TILE;
            let mut acc = [0.0f32; TILE];
            let middle = &column[centre..][..TILE];
            for i in 0..TILE {
                acc[i] = half[0] * middle[i];
            }
            for k in 1..=radius {
                let above = &column[centre - k * TILE..][..TILE];
                let below = &column[centre + k * TILE..][..TILE];
                for i in 0..TILE {
                    acc[i] += half[k] * (above[i] + below[i]);
                }
            }
            let out = &mut out[x..x + n];
            if n == TILE {
                out.copy_from_slice(&acc);
            } else {
                out.copy_from_slice(&acc[..n]);
            }
        }
    }
}

/// Copies a row of `channels` interleaved samples with `radius` mirrored pixels on both sides.
pub(crate) fn pad_row(row: &[f32], channels: usize, radius: usize, line: &mut Vec<f32>) {
    let width = row.len() / channels;
    line.clear();
    let pixel = |x: isize| {
        let x = reflect(x, width) * channels;
        &row[x..x + channels]
    };
    for x in -(radius as isize)..0 {
        line.extend_from_slice(pixel(x));
    }
    line.extend_from_slice(row);
    for x in 0..radius as isize {
        line.extend_from_slice(pixel(width as isize + x));
    }
}

fn blur_rows(data: &[f32], stride: usize, channels: usize, half: &[f32]) -> Vec<f32> {
    let mut across = vec![0.0f32; data.len()];
    across
        .par_chunks_mut(stride)
        .zip(data.par_chunks(stride))
        .for_each_init(Vec::new, |line, (out, row)| {
            pad_row(row, channels, half.len() - 1, line);
            convolve_line(line, out, half, channels);
        });
    across
}

fn blur(data: &[f32], width: usize, height: usize, channels: usize, sigma: f64) -> Vec<f32> {
    let half = kernel(sigma);
    let stride = width * channels;
    let across = blur_rows(data, stride, channels, &half);
    let mut out = vec![0.0f32; data.len()];
    out.par_chunks_mut(BAND * stride)
        .enumerate()
        .for_each_init(Vec::new, |column, (band, out)| {
            convolve_columns(&across, stride, height, band * BAND, &half, column, out);
        });
    out
}

/// Decodes an encoded picture to light, blurs it, and hands every row's light and blurred light to `f` with the
/// row's index and the matching row of `out`.
///
/// Neither the light nor its blur is stored as a whole picture: rows are decoded twice, which costs less than
/// writing them to memory and reading them back.
pub fn blurred_light_rows<T: Send>(
    picture: &SrgbImage,
    sigma: f64,
    out: &mut [T],
    f: impl Fn(usize, &[[f32; 3]], &[f32], &mut [T]) + Sync,
) {
    let (width, height) = picture.size();
    assert_eq!(out.len(), picture.len(), "one output a pixel");
    if picture.is_empty() {
        return;
    }
    if sigma.is_nan() || sigma <= 0.0 || sigma > DIRECT_SIGMA {
        let light = colour::light(picture);
        let blurred = gaussian_rgb(&light, sigma);
        out.par_chunks_mut(width)
            .enumerate()
            .for_each(|(y, out)| f(y, light.row(y), blurred.row(y).as_flattened(), out));
        return;
    }
    let half = kernel(sigma);
    let stride = width * 3;
    let decode = |y: usize, light: &mut [[f32; 3]]| {
        light.copy_from_slice(picture.row(y));
        colour::light_slice(light.as_flattened_mut());
    };
    let mut across = vec![0.0f32; picture.len() * 3];
    across.par_chunks_mut(stride).enumerate().for_each_init(
        || (vec![[0.0; 3]; width], Vec::new()),
        |(light, line), (y, out)| {
            decode(y, light);
            pad_row(light.as_flattened(), 3, half.len() - 1, line);
            convolve_line(line, out, &half, 3);
        },
    );
    out.par_chunks_mut(BAND * width).enumerate().for_each_init(
        || (vec![[0.0; 3]; width], Vec::new(), vec![0.0; BAND * stride]),
        |(light, column, blurred), (band, out)| {
            let blurred = &mut blurred[..out.len() * 3];
            convolve_columns(&across, stride, height, band * BAND, &half, column, blurred);
            for (i, (out, blurred)) in out.chunks_mut(width).zip(blurred.chunks(stride)).enumerate() {
                let y = band * BAND + i;
                decode(y, light);
                f(y, light, blurred, out);
            }
        },
    );
}

/// How far to reduce before blurring with a wide kernel, and the σ left to apply there.
fn reduction(sigma: f64, width: usize, height: usize) -> Option<(usize, usize, f64)> {
    if sigma <= DIRECT_SIGMA {
        return None;
    }
    let factor = (sigma / (DIRECT_SIGMA / 2.0)).floor();
    let (w, h) = (
        (width as f64 / factor).ceil() as usize,
        (height as f64 / factor).ceil() as usize,
    );
    let rest = sigma * sigma - (factor * factor - 1.0) / 12.0 - factor * factor / 6.0;
    Some((w.max(1), h.max(1), rest.sqrt() / factor))
}

/// Gaussian blur with standard deviation `sigma` in pixels; a copy when `sigma <= 0` or the raster is empty.
pub fn gaussian(field: &Field, sigma: f64) -> Field {
    let (width, height) = field.size();
    if field.is_empty() || sigma.is_nan() || sigma <= 0.0 {
        return field.clone();
    }
    if let Some((w, h, rest)) = reduction(sigma, width, height) {
        return resize(&gaussian(&resize(field, w, h), rest), width, height);
    }
    Field::from_vec(width, height, blur(field.data(), width, height, 1, sigma))
}

/// [`gaussian`] of each channel.
pub fn gaussian_rgb<S: Space>(image: &Rgb<S>, sigma: f64) -> Rgb<S> {
    let (width, height) = image.size();
    if image.is_empty() || sigma.is_nan() || sigma <= 0.0 {
        return image.clone();
    }
    if let Some((w, h, rest)) = reduction(sigma, width, height) {
        return resize_rgb(&gaussian_rgb(&resize_rgb(image, w, h), rest), width, height);
    }
    let flat = blur(image.data().as_flattened(), width, height, 3, sigma);
    let pixels = flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    Rgb::from_vec(width, height, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    mod oracle {
        use super::*;

        /// Direct two-dimensional sum in f64.
        pub fn gaussian(f: &Field, sigma: f64) -> Field {
            let r = (4.0 * sigma + 0.5) as isize;
            let w = |i: isize| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma));
            let total: f64 = (-r..=r).map(w).sum();
            Field::from_fn(f.width(), f.height(), |x, y| {
                let mut sum = 0.0;
                for j in -r..=r {
                    for i in -r..=r {
                        let px = reflect(x as isize + i, f.width());
                        let py = reflect(y as isize + j, f.height());
                        sum += w(i) * w(j) * f64::from(f.at(px, py));
                    }
                }
                (sum / (total * total)) as f32
            })
        }
    }

    fn noise(width: usize, height: usize) -> Field {
        Field::from_fn(width, height, |x, y| ((x * 7919 + y * 104_729) % 997) as f32 / 997.0)
    }

    #[test]
    fn agrees_with_the_direct_sum_for_any_shape() {
        for (w, h) in [(1, 1), (1, 9), (40, 1), (37, 23), (3, 70)] {
            for sigma in [0.6, 1.0, 3.3] {
                let f = noise(w, h);
                let (fast, slow) = (gaussian(&f, sigma), oracle::gaussian(&f, sigma));
                for (a, b) in fast.data().iter().zip(slow.data()) {
                    assert!((a - b).abs() < 1e-6, "{w}x{h} at {sigma}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_colour_image_is_blurred_channel_by_channel() {
        let f = noise(45, 31);
        let image = Rgb::<crate::Linear>::from_fn(45, 31, |x, y| [f.at(x, y), 0.5, 1.0 - f.at(x, y)]);
        let (blurred, plain) = (gaussian_rgb(&image, 2.0), gaussian(&f, 2.0));
        for (rgb, &g) in blurred.data().iter().zip(plain.data()) {
            assert!((rgb[0] - g).abs() < 1e-6 && (rgb[1] - 0.5).abs() < 1e-6 && (rgb[2] - 1.0 + g).abs() < 1e-6);
        }
    }

    #[test]
    fn a_wide_kernel_at_low_resolution_stays_within_one_percent_of_a_step() {
        let step = Field::from_fn(300, 180, |x, _| if x < 130 { 0.0 } else { 1.0 });
        let direct = Field::from_vec(300, 180, blur(step.data(), 300, 180, 1, 30.0));
        let reduced = gaussian(&step, 30.0);
        let worst = direct
            .data()
            .iter()
            .zip(reduced.data())
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(worst < 0.01, "{worst}");
    }
}
