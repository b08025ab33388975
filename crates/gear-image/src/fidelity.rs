//! How well one picture shows another: PSNR and SSIM inside a mask, on encoded values.
//!
//! PSNR = 10 log₁₀(1/MSE) over all channels of all mask pixels. SSIM (Wang et al. 2004) is the mean over mask pixels
//! and channels, with an 11 × 11 Gaussian window (σ 1.5) restricted to the mask and normalised there, so that what
//! lies beyond the silhouette, which is not asked for, has no say.

use rayon::prelude::*;

use crate::{Mask, SrgbImage};

/// What an error of zero is reported as, in dB: infinity has no place in JSON.
pub const MAX_PSNR_DB: f64 = 120.0;

const RADIUS: isize = 5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Peak signal-to-noise ratio in dB; `None` on an empty mask. The three rasters have one size.
pub fn psnr(shown: &SrgbImage, painting: &SrgbImage, mask: &Mask) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for ((a, b), _) in shown
        .data()
        .iter()
        .zip(painting.data())
        .zip(mask.data())
        .filter(|(_, m)| **m)
    {
        for c in 0..3 {
            let d = f64::from(a[c].clamp(0.0, 1.0)) - f64::from(b[c].clamp(0.0, 1.0));
            sum += d * d;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| {
        let mse: f64 = sum / count;
        if mse > 0.0 {
            (-10.0 * libm::log10(mse)).min(MAX_PSNR_DB)
        } else {
            MAX_PSNR_DB
        }
    })
}

/// Structural similarity in −1..=1; `None` on an empty mask. The three rasters have one size.
pub fn ssim(shown: &SrgbImage, painting: &SrgbImage, mask: &Mask) -> Option<f64> {
    let (width, height) = mask.size();
    let weight: Vec<f64> = (-RADIUS..=RADIUS).map(|d| libm::exp(-((d * d) as f64) / 4.5)).collect();
    let rows: Vec<(f64, f64)> = (0..height)
        .into_par_iter()
        .map(|y| {
            let (mut sum, mut count) = (0.0, 0.0);
            for x in (0..width).filter(|&x| mask.at(x, y)) {
                sum += pixel(shown, painting, mask, &weight, x, y);
                count += 1.0;
            }
            (sum, count)
        })
        .collect();
    let (sum, count) = rows.iter().fold((0.0, 0.0), |t, r| (t.0 + r.0, t.1 + r.1));
    (count > 0.0).then(|| sum / count)
}

/// SSIM at a pixel, mean of the channels.
fn pixel(a: &SrgbImage, b: &SrgbImage, mask: &Mask, weight: &[f64], x: usize, y: usize) -> f64 {
    let (width, height) = (mask.width() as isize, mask.height() as isize);
    let (x, y) = (x as isize, y as isize);
    let mut total = 0.0;
    // Moments of both pictures: mean a, mean b, a², b², ab.
    let mut moments = [[0.0; 5]; 3];
    for v in (y - RADIUS).max(0)..=(y + RADIUS).min(height - 1) {
        for u in (x - RADIUS).max(0)..=(x + RADIUS).min(width - 1) {
            let (i, j) = (u as usize, v as usize);
            if !mask.at(i, j) {
                continue;
            }
            let w = weight[(v - y + RADIUS) as usize] * weight[(u - x + RADIUS) as usize];
            total += w;
            for ((m, p), q) in moments.iter_mut().zip(a.at(i, j)).zip(b.at(i, j)) {
                let (p, q) = (f64::from(p.clamp(0.0, 1.0)), f64::from(q.clamp(0.0, 1.0)));
                for (m, v) in m.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                    *m += w * v;
                }
            }
        }
    }
    let channel = |m: &[f64; 5]| {
        let [ma, mb, aa, bb, ab] = m.map(|v| v / total);
        let (va, vb, cov) = ((aa - ma * ma).max(0.0), (bb - mb * mb).max(0.0), ab - ma * mb);
        (2.0 * ma * mb + C1) * (2.0 * cov + C2) / ((ma * ma + mb * mb + C1) * (va + vb + C2))
    };
    moments.iter().map(channel).fold(0.0, |s, v| s + v) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(shift: f32) -> SrgbImage {
        SrgbImage::from_fn(40, 30, |x, y| {
            let v = ((x * 7 + y * 13) % 17) as f32 / 17.0;
            [v * 0.8 + shift, v * 0.5 + shift, 0.3 + shift]
        })
    }

    #[test]
    fn a_picture_equals_itself() {
        let mask = Mask::filled(40, 30, true);
        assert_eq!(psnr(&texture(0.0), &texture(0.0), &mask), Some(MAX_PSNR_DB));
        assert!((ssim(&texture(0.0), &texture(0.0), &mask).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_offset_of_a_tenth_is_twenty_db() {
        let mask = Mask::filled(40, 30, true);
        let db = psnr(&texture(0.0), &texture(0.1), &mask).unwrap();
        assert!((db - 20.0).abs() < 1e-4, "{db}");
        let s = ssim(&texture(0.0), &texture(0.1), &mask).unwrap();
        assert!(s < 0.99 && s > 0.5, "{s}");
    }

    #[test]
    fn only_the_mask_counts_and_an_empty_one_is_undefined() {
        let mask = Mask::from_fn(40, 30, |x, y| (x as i32 - 20).pow(2) + (y as i32 - 15).pow(2) < 100);
        let mut other = texture(0.0);
        for y in 0..30 {
            for x in 0..40 {
                if !mask.at(x, y) {
                    other.set(x, y, [1.0; 3]);
                }
            }
        }
        assert_eq!(psnr(&other, &texture(0.0), &mask), Some(MAX_PSNR_DB));
        assert!((ssim(&other, &texture(0.0), &mask).unwrap() - 1.0).abs() < 1e-12);
        let empty = Mask::filled(40, 30, false);
        assert_eq!(psnr(&other, &texture(0.0), &empty), None);
        assert_eq!(ssim(&other, &texture(0.0), &empty), None);
    }
}
