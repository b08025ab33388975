//! Sums, means and quantiles whose bits do not depend on the number of threads.
//!
//! A sum is taken over fixed chunks of 2¹⁴ values, each into 16 lanes of f64 that are added as one tree; the
//! chunks' sums are added in order. Threads take whole chunks, so the shape never changes.

use multiversion::multiversion;
use rayon::prelude::*;

const CHUNK: usize = 1 << 14;
const LANES: usize = 16;

#[inline(always)]
fn tree(lanes: [f64; LANES]) -> f64 {
    let mut lanes = lanes;
    let mut n = LANES / 2;
    while n > 0 {
        for i in 0..n {
            lanes[i] += lanes[i + n];
        }
        n /= 2;
    }
    lanes[0]
}

#[multiversion(targets = "simd")]
fn sum_chunk(xs: &[f32]) -> f64 {
    let mut lanes = [0.0f64; LANES];
    let mut rows = xs.chunks_exact(LANES);
    for row in &mut rows {
        for i in 0..LANES {
            lanes[i] += f64::from(row[i]);
        }
    }
    for (lane, &x) in lanes.iter_mut().zip(rows.remainder()) {
        *lane += f64::from(x);
    }
    tree(lanes)
}

#[multiversion(targets = "simd")]
fn sum_squares_chunk(xs: &[f32], centre: f64) -> f64 {
    let mut lanes = [0.0f64; LANES];
    let mut rows = xs.chunks_exact(LANES);
    for row in &mut rows {
        for i in 0..LANES {
            let d = f64::from(row[i]) - centre;
            lanes[i] += d * d;
        }
    }
    for (lane, &x) in lanes.iter_mut().zip(rows.remainder()) {
        let d = f64::from(x) - centre;
        *lane += d * d;
    }
    tree(lanes)
}

fn chunked(xs: &[f32], f: impl Fn(&[f32]) -> f64 + Sync + Send) -> f64 {
    let sums: Vec<f64> = xs.par_chunks(CHUNK).map(f).collect();
    sums.iter().sum()
}

/// Sum in f64.
pub fn sum(xs: &[f32]) -> f64 {
    chunked(xs, sum_chunk)
}

/// Mean in f64; 0 of nothing.
pub fn mean(xs: &[f32]) -> f64 {
    if xs.is_empty() { 0.0 } else { sum(xs) / xs.len() as f64 }
}

/// Mean and population standard deviation in f64, in two passes; (0, 0) of nothing.
pub fn mean_and_deviation(xs: &[f32]) -> (f64, f64) {
    if xs.is_empty() {
        return (0.0, 0.0);
    }
    let mean = mean(xs);
    let squares = chunked(xs, |chunk| sum_squares_chunk(chunk, mean));
    (mean, (squares / xs.len() as f64).sqrt())
}

#[multiversion(targets = "simd")]
fn range_chunk(xs: &[f32]) -> (f32, f32) {
    let mut low = f32::INFINITY;
    let mut high = f32::NEG_INFINITY;
    for &x in xs {
        low = if x < low { x } else { low };
        high = if x > high { x } else { high };
    }
    (low, high)
}

/// (least, greatest), NaNs left out; `None` of nothing.
pub fn range(xs: &[f32]) -> Option<(f32, f32)> {
    let parts: Vec<(f32, f32)> = xs.par_chunks(CHUNK).map(range_chunk).collect();
    let (low, high) = parts
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    (low <= high).then_some((low, high))
}

/// The `q`-quantile (0..=1) with linear interpolation between order statistics, as numpy's default;
/// NaNs sort last. `None` of nothing.
pub fn quantile(xs: &[f32], q: f64) -> Option<f32> {
    quantile_in_place(&mut xs.to_vec(), q)
}

/// [`quantile`] that reorders its input instead of copying it.
pub fn quantile_in_place(xs: &mut [f32], q: f64) -> Option<f32> {
    if xs.is_empty() {
        return None;
    }
    let position = q.clamp(0.0, 1.0) * (xs.len() - 1) as f64;
    let index = position.floor() as usize;
    let (_, &mut low, above) = xs.select_nth_unstable_by(index, f32::total_cmp);
    let high = above.iter().copied().min_by(f32::total_cmp).unwrap_or(low);
    let t = position - index as f64;
    Some(if t == 0.0 {
        low
    } else {
        (f64::from(low) + t * (f64::from(high) - f64::from(low))) as f32
    })
}

/// The median.
pub fn median(xs: &[f32]) -> Option<f32> {
    quantile(xs, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_f64() {
        let xs: Vec<f32> = (0..100_003)
            .map(|i| ((i * 7919) % 1000) as f32 * 0.001 + 100.0)
            .collect();
        let slow: f64 = xs.iter().map(|&x| f64::from(x)).sum();
        assert!((sum(&xs) - slow).abs() < 1e-9 * slow);
        let (mean, deviation) = mean_and_deviation(&xs);
        let variance = xs
            .iter()
            .map(|&x| (f64::from(x) - mean) * (f64::from(x) - mean))
            .sum::<f64>();
        assert!((deviation - (variance / xs.len() as f64).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn quantiles_interpolate_like_numpy() {
        let xs = [3.0, 1.0, 2.0, 10.0];
        assert_eq!(quantile(&xs, 0.0), Some(1.0));
        assert_eq!(quantile(&xs, 1.0), Some(10.0));
        assert_eq!(median(&xs), Some(2.5));
        assert_eq!(quantile(&xs, 0.9), Some(7.9));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn the_same_bits_on_any_thread_count() {
        let xs: Vec<f32> = (0..200_000).map(|i| ((i * 31) % 977) as f32 / 97.0 - 3.0).collect();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mean_and_deviation(&xs))
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(7));
    }
}
