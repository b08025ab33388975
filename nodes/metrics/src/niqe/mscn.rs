//! Mean-subtracted, contrast-normalised coefficients: (I − μ) / (σ + 1).

use rayon::prelude::*;

use super::luma::Plane;

const RADIUS: usize = 3;
const SIDE: usize = 2 * RADIUS + 1;

/// The normalised 7 × 7 Gaussian, σ = 7/6.
fn window() -> [[f64; SIDE]; SIDE] {
    let sigma = 7.0 / 6.0;
    let mut window = [[0.0; SIDE]; SIDE];
    let mut sum = 0.0;
    for (y, row) in window.iter_mut().enumerate() {
        for (x, w) in row.iter_mut().enumerate() {
            let (dx, dy) = (x as f64 - RADIUS as f64, y as f64 - RADIUS as f64);
            *w = libm::exp(-(dx * dx + dy * dy) / (2.0 * sigma * sigma));
            sum += *w;
        }
    }
    window.map(|row| row.map(|w| w / sum))
}

/// The coefficients of a plane; samples beyond the rim repeat the rim's.
///
/// With d the differences from the centre pixel, I − μ = −Σ w d and σ² = Σ w d² − (Σ w d)²: no cancellation
/// of large numbers, and exactly zero where the window is constant.
pub(super) fn mscn(plane: &Plane) -> Plane {
    let window = window();
    let (width, height) = (plane.width, plane.height);
    let mut data = vec![0.0; width * height];
    data.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let rows: [&[f64]; SIDE] = std::array::from_fn(|k| {
            let y = (y + k).saturating_sub(RADIUS).min(height - 1);
            &plane.data[y * width..(y + 1) * width]
        });
        for (x, out) in out.iter_mut().enumerate() {
            let centre = rows[RADIUS][x];
            let inside = x >= RADIUS && x + RADIUS < width;
            let (mut mean, mut square) = (0.0, 0.0);
            for (row, weights) in rows.iter().zip(&window) {
                for (k, w) in weights.iter().enumerate() {
                    let at = if inside {
                        x + k - RADIUS
                    } else {
                        (x + k).saturating_sub(RADIUS).min(width - 1)
                    };
                    let d = row[at] - centre;
                    mean += w * d;
                    square += w * d * d;
                }
            }
            let deviation = (square - mean * mean).abs().sqrt();
            *out = -mean / (deviation + 1.0);
        }
    });
    Plane { width, height, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_is_the_references() {
        let window = window();
        assert!((window[0][0] - 0.00015776).abs() < 1e-8);
        assert!((window[0][3] - 0.00430352).abs() < 1e-8);
        let sum: f64 = window.iter().flatten().fold(0.0, |s, w| s + w);
        assert!((sum - 1.0).abs() < 1e-14);
    }

    #[test]
    fn constant_in_exact_zero_out() {
        let flat = Plane {
            width: 9,
            height: 8,
            data: vec![235.0; 72],
        };
        assert!(mscn(&flat).data.iter().all(|&v| v == 0.0));
    }
}
