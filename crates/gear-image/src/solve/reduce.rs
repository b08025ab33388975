//! Sums whose bits do not depend on the number of threads: fixed chunks, fixed lanes, one order.

use rayon::prelude::*;

const CHUNK: usize = 8192;
const LANES: usize = 8;

fn lanes(n: usize, term: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0f64; LANES];
    for block in 0..n / LANES {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += term(block * LANES + lane);
        }
    }
    for i in n / LANES * LANES..n {
        sums[i % LANES] += term(i);
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

/// `Σ a_i b_i`.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "a dot product needs equal lengths");
    let parts: Vec<f64> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| lanes(a.len(), |i| a[i] * b[i]))
        .collect();
    parts.iter().sum()
}

/// `Σ a_i`.
pub fn sum(a: &[f64]) -> f64 {
    let parts: Vec<f64> = a.par_chunks(CHUNK).map(|a| lanes(a.len(), |i| a[i])).collect();
    parts.iter().sum()
}
