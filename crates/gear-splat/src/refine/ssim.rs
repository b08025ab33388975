//! Structural similarity (Wang 2004) of one channel, and its gradient.
//!
//! With K a normalised Gaussian window of 11 × 11, σ = 1.5 (zeros beyond the rim, as in 3DGS), μ = K∗x, σ² = K∗x² − μ²,
//! σ_xy = K∗xy − μ_x μ_y:
//!
//! S = (2 μ_x μ_y + C₁)(2 σ_xy + C₂) / ((μ_x² + μ_y² + C₁)(σ_x² + σ_y² + C₂)).
//!
//! S is a function of the three blurred maps of x, and K is symmetric, so the gradient of Σ v S by x is three more blurs:
//! K∗(v ∂S/∂μ) + 2x · K∗(v ∂S/∂(K∗x²)) + y · K∗(v ∂S/∂(K∗xy)).

use multiversion::multiversion;
use rayon::prelude::*;

const C1: f32 = 1e-4;
const C2: f32 = 9e-4;
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;

/// The window, narrower where a picture is.
#[derive(Clone, Debug)]
pub(super) struct Window {
    weights: Vec<f32>,
}

impl Window {
    pub fn for_size(width: usize, height: usize) -> Self {
        let side = WINDOW.min(width).min(height).max(1);
        let radius = (side - 1) / 2;
        let raw: Vec<f64> = (0..=2 * radius)
            .map(|i| {
                let d = (i as f64 - radius as f64) / SIGMA;
                libm::exp(-0.5 * d * d)
            })
            .collect();
        let total: f64 = raw.iter().sum();
        Self {
            weights: raw.iter().map(|w| (w / total) as f32).collect(),
        }
    }

    pub fn radius(&self) -> usize {
        self.weights.len() / 2
    }

    /// K ∗ plane, zeros beyond the rim.
    pub fn blur(&self, plane: &[f32], width: usize) -> Vec<f32> {
        let height = plane.len() / width.max(1);
        let radius = self.radius();
        let mut rows = vec![0.0; plane.len()];
        rows.par_chunks_mut(width)
            .zip(plane.par_chunks(width))
            .with_min_len(16)
            .for_each_init(
                || vec![0.0; width + 2 * radius],
                |padded, (out, row)| {
                    padded[radius..radius + width].copy_from_slice(row);
                    along(padded, out, &self.weights);
                },
            );
        let mut out = vec![0.0; plane.len()];
        out.par_chunks_mut(width)
            .with_min_len(16)
            .enumerate()
            .for_each(|(y, out)| {
                for (k, &weight) in self.weights.iter().enumerate() {
                    let from = (y + k).wrapping_sub(radius);
                    if from < height {
                        add_scaled(out, &rows[from * width..(from + 1) * width], weight);
                    }
                }
            });
        out
    }
}

#[multiversion(targets = "simd")]
fn along(padded: &[f32], out: &mut [f32], weights: &[f32]) {
    for (k, &weight) in weights.iter().enumerate() {
        let shifted = &padded[k..k + out.len()];
        if k == 0 {
            for (out, x) in out.iter_mut().zip(shifted) {
                *out = weight * x;
            }
        } else {
            for (out, x) in out.iter_mut().zip(shifted) {
                *out += weight * x;
            }
        }
    }
}

#[multiversion(targets = "simd")]
fn add_scaled(out: &mut [f32], row: &[f32], weight: f32) {
    for (out, x) in out.iter_mut().zip(row) {
        *out += weight * x;
    }
}

/// What a target contributes, computed once.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    pub y: Vec<f32>,
    mean: Vec<f32>,
    square: Vec<f32>,
}

impl Fixed {
    pub fn new(y: Vec<f32>, width: usize, window: &Window) -> Self {
        let squares: Vec<f32> = y.iter().map(|y| y * y).collect();
        Self {
            mean: window.blur(&y, width),
            square: window.blur(&squares, width),
            y,
        }
    }
}

/// S at every pixel, and its derivatives by the blurred maps of x.
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
    let s = a1 * a2 / (b1 * b2);
    let by_product = 2.0 * a1 / (b1 * b2);
    let by_square = -s / b2;
    let direct = 2.0 * mean_y * a2 / (b1 * b2) - 2.0 * mean_x * s / b1;
    Similarity {
        s,
        by_mean: direct - mean_y * by_product - 2.0 * mean_x * by_square,
        by_square,
        by_product,
    }
}

/// The blurred maps of x, and of x with y.
fn maps(x: &[f32], fixed: &Fixed, width: usize, window: &Window) -> [Vec<f32>; 3] {
    let squares: Vec<f32> = x.iter().map(|x| x * x).collect();
    let products: Vec<f32> = x.iter().zip(&fixed.y).map(|(x, y)| x * y).collect();
    [x, squares.as_slice(), products.as_slice()].map(|plane| window.blur(plane, width))
}

/// Σ v S.
pub(super) fn weighted_sum(x: &[f32], fixed: &Fixed, v: &[f32], width: usize, window: &Window) -> f64 {
    let [mean, square, product] = maps(x, fixed, width, window);
    let mut total = 0.0;
    for i in 0..x.len() {
        if v[i] != 0.0 {
            let s = similarity(mean[i], square[i], product[i], fixed.mean[i], fixed.square[i]).s;
            total += f64::from(v[i]) * f64::from(s);
        }
    }
    total
}

/// The gradient of Σ v S by x.
pub(super) fn gradient(x: &[f32], fixed: &Fixed, v: &[f32], width: usize, window: &Window) -> Vec<f32> {
    let [mut mean, mut square, mut product] = maps(x, fixed, width, window);
    differentiate(&mut mean, &mut square, &mut product, fixed, v);
    let [mut mean, square, product] = [mean, square, product].map(|plane| window.blur(&plane, width));
    for i in 0..x.len() {
        mean[i] += 2.0 * x[i] * square[i] + fixed.y[i] * product[i];
    }
    mean
}

/// Replaces the maps by v times the derivatives of S by them.
fn differentiate(mean: &mut [f32], square: &mut [f32], product: &mut [f32], fixed: &Fixed, v: &[f32]) {
    const CHUNK: usize = 1 << 13;
    mean.par_chunks_mut(CHUNK)
        .zip(square.par_chunks_mut(CHUNK))
        .zip(product.par_chunks_mut(CHUNK))
        .zip(fixed.mean.par_chunks(CHUNK).zip(fixed.square.par_chunks(CHUNK)))
        .zip(v.par_chunks(CHUNK))
        .for_each(|((((mean, square), product), (mean_y, square_y)), v)| {
            for i in 0..mean.len() {
                let d = similarity(mean[i], square[i], product[i], mean_y[i], square_y[i]);
                mean[i] = v[i] * d.by_mean;
                square[i] = v[i] * d.by_square;
                product[i] = v[i] * d.by_product;
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u32, len: usize) -> Vec<f32> {
        (0..len as u32)
            .map(|i| {
                let mut h = (i ^ seed.wrapping_mul(0x9E37_79B9)).wrapping_mul(0x85EB_CA6B);
                h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
                ((h ^ (h >> 16)) >> 8) as f32 / (1 << 24) as f32
            })
            .collect()
    }

    /// SSIM by its definition, f64, one window at a time.
    fn oracle(x: &[f64], y: &[f64], v: &[f32], width: usize, window: &Window) -> f64 {
        let height = x.len() / width;
        let r = window.radius() as isize;
        let mut total = 0.0;
        for cy in 0..height as isize {
            for cx in 0..width as isize {
                let mut sums = [0.0f64; 5];
                for dy in -r..=r {
                    for dx in -r..=r {
                        let (px, py) = (cx + dx, cy + dy);
                        if px < 0 || py < 0 || px >= width as isize || py >= height as isize {
                            continue;
                        }
                        let w =
                            f64::from(window.weights[(dx + r) as usize]) * f64::from(window.weights[(dy + r) as usize]);
                        let at = py as usize * width + px as usize;
                        let (a, b) = (x[at], y[at]);
                        for (sum, term) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                            *sum += w * term;
                        }
                    }
                }
                let [mx, my, xx, yy, xy] = sums;
                let (c1, c2) = (f64::from(C1), f64::from(C2));
                let s = (2.0 * mx * my + c1) * (2.0 * (xy - mx * my) + c2)
                    / ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2));
                total += s * f64::from(v[cy as usize * width + cx as usize]);
            }
        }
        total
    }

    #[test]
    fn the_value_and_the_gradient_agree_with_the_definition() {
        for (width, height) in [(19, 14), (5, 9), (1, 1), (30, 2)] {
            let n = width * height;
            let (x, y, v) = (noise(1, n), noise(2, n), noise(3, n));
            let window = Window::for_size(width, height);
            let fixed = Fixed::new(y.clone(), width, &window);
            let wide = |a: &[f32]| a.iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
            let exact = oracle(&wide(&x), &wide(&y), &v, width, &window);
            let found = weighted_sum(&x, &fixed, &v, width, &window);
            assert!((found - exact).abs() < 2e-5 * n as f64, "{found} {exact}");

            let gradient = gradient(&x, &fixed, &v, width, &window);
            for i in (0..n).step_by(n.div_ceil(12)) {
                let at = |h: f64| {
                    let mut moved = wide(&x);
                    moved[i] += h;
                    oracle(&moved, &wide(&y), &v, width, &window)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!(
                    (slope - f64::from(gradient[i])).abs() < 2e-3 * slope.abs().max(1.0),
                    "{i}: {slope} {}",
                    gradient[i]
                );
            }
        }
    }

    #[test]
    fn a_picture_is_wholly_similar_to_itself() {
        let x = noise(7, 400);
        let window = Window::for_size(20, 20);
        let fixed = Fixed::new(x.clone(), 20, &window);
        let v = vec![1.0; 400];
        assert!((weighted_sum(&x, &fixed, &v, 20, &window) - 400.0).abs() < 1e-3);
        assert!(gradient(&x, &fixed, &v, 20, &window).iter().all(|g| g.abs() < 2e-3));
    }
}
