//! MATLAB's `imresize(·, ½)`: bicubic (a = −½), widened twofold against aliasing, mirrored rim.

use super::luma::Plane;

/// Output i is centred between inputs 2i and 2i + 1, and takes the eight from 2i − 3.
const TAPS: usize = 8;
const FIRST: isize = -3;

/// Keys' cubic kernel, a = −½.
fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x <= 1.0 {
        (1.5 * x - 2.5) * x * x + 1.0
    } else if x <= 2.0 {
        ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    } else {
        0.0
    }
}

fn weights() -> [f64; TAPS] {
    let raw: [f64; TAPS] = std::array::from_fn(|k| cubic((k as f64 + FIRST as f64 - 0.5) / 2.0));
    let sum = raw.iter().fold(0.0, |s, w| s + w);
    raw.map(|w| w / sum)
}

/// Half-sample symmetric continuation: −1 → 0, n → n − 1.
fn mirrored(i: isize, n: usize) -> usize {
    let n = n as isize;
    let i = if i < 0 { -1 - i } else { i };
    (if i >= n { 2 * n - 1 - i } else { i }).clamp(0, n - 1) as usize
}

/// The plane at half its (even) size.
pub(super) fn half(plane: &Plane) -> Plane {
    let weights = weights();
    let (width, height) = (plane.width / 2, plane.height / 2);
    let mut short = vec![0.0; plane.width * height];
    for y in 0..height {
        let out = &mut short[y * plane.width..(y + 1) * plane.width];
        for (k, w) in weights.iter().enumerate() {
            let from = mirrored(2 * y as isize + FIRST + k as isize, plane.height);
            let row = &plane.data[from * plane.width..(from + 1) * plane.width];
            for (out, v) in out.iter_mut().zip(row) {
                *out += w * v;
            }
        }
    }
    let mut data = Vec::with_capacity(width * height);
    for row in short.chunks_exact(plane.width) {
        for x in 0..width {
            let mut sum = 0.0;
            for (k, w) in weights.iter().enumerate() {
                sum += w * row[mirrored(2 * x as isize + FIRST + k as isize, plane.width)];
            }
            data.push(sum);
        }
    }
    Plane { width, height, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_inside() {
        let ramp = Plane {
            width: 32,
            height: 32,
            data: (0..32 * 32).map(|i| (i % 32) as f64).collect(),
        };
        let half = half(&ramp);
        for x in 2..14 {
            assert!((half.data[8 * 16 + x] - (2.0 * x as f64 + 0.5)).abs() < 1e-12);
        }
    }

    #[test]
    fn constant_in_constant_out() {
        let flat = Plane {
            width: 12,
            height: 10,
            data: vec![173.0; 120],
        };
        let half = half(&flat);
        assert!(
            half.data
                .iter()
                .all(|&v| v == half.data[0] && (v - 173.0).abs() < 1e-10)
        );
    }
}
