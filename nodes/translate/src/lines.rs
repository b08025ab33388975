//! What drawn styles share: the tangent field of contours, line integrals along it, soft thresholded lines, grain.

use gear_image::filter::{bilinear, gaussian, gradient};
use gear_image::{Field, SrgbImage, colour, math};
use rayon::prelude::*;

/// Encoded luminance: tone as it is seen.
pub(crate) fn tone(painting: &SrgbImage) -> Field {
    let mut tone = colour::light(painting).luminance();
    for t in tone.data_mut() {
        *t = colour::to_srgb(*t);
    }
    tone
}

/// Directions without a sign, as cosine and sine of twice the angle.
pub(crate) struct Directions {
    cos2: Field,
    sin2: Field,
}

impl Directions {
    /// One direction everywhere: (x, y) down-right positive, need not be a unit vector.
    pub fn constant(width: usize, height: usize, x: f32, y: f32) -> Self {
        let size = (x * x + y * y).max(1e-12);
        Self {
            cos2: Field::filled(width, height, (x * x - y * y) / size),
            sin2: Field::filled(width, height, 2.0 * x * y / size),
        }
    }

    /// Tangents of the contours of `tone`: the minor axis of the structure tensor `G_σ ∗ ∇t ∇tᵀ`.
    pub fn tangents(tone: &Field, sigma: f64) -> Self {
        let (gx, gy) = gradient(tone);
        let product = |a: &Field, b: &Field| {
            let data = a.data().iter().zip(b.data()).map(|(a, b)| a * b).collect();
            gaussian(&Field::from_vec(a.width(), a.height(), data), sigma)
        };
        let (xx, xy, yy) = (product(&gx, &gx), product(&gx, &gy), product(&gy, &gy));
        // The gradient's doubled angle is atan2(2xy, xx − yy); the tangent's is half a turn further.
        let (w, h) = tone.size();
        let mut cos2 = Field::filled(w, h, 1.0);
        let mut sin2 = Field::filled(w, h, 0.0);
        for p in 0..tone.len() {
            let (c, s) = (xx.data()[p] - yy.data()[p], 2.0 * xy.data()[p]);
            let size = (c * c + s * s).sqrt();
            if size > 1e-12 {
                cos2.data_mut()[p] = -c / size;
                sin2.data_mut()[p] = -s / size;
            }
        }
        Self { cos2, sin2 }
    }

    /// Cosine of the angle (not doubled), in [0, 1], at a pixel: 1 along the rows.
    pub fn cosine(&self, p: usize) -> f32 {
        (0.5 * (1.0 + self.cos2.data()[p])).max(0.0).sqrt()
    }

    /// The unit direction at a point, with an arbitrary but fixed sign.
    fn at(&self, x: f32, y: f32) -> [f32; 2] {
        let (c, s) = (bilinear(&self.cos2, x, y), bilinear(&self.sin2, x, y));
        let size = (c * c + s * s).sqrt().max(1e-9);
        let c = c / size;
        let across = (0.5 * (1.0 + c)).max(0.0).sqrt();
        let down = (0.5 * (1.0 - c)).max(0.0).sqrt();
        if s < 0.0 { [across, -down] } else { [across, down] }
    }
}

/// Line integral convolution: the mean of `field` over `steps` unit steps to both sides along `directions`.
pub(crate) fn integrate(field: &Field, directions: &Directions, steps: usize) -> Field {
    let (w, h) = field.size();
    let mut out = field.clone();
    out.data_mut()
        .par_chunks_mut(w.max(1))
        .enumerate()
        .for_each(|(row, out)| {
            for (column, out) in out.iter_mut().enumerate() {
                let mut sum = *out;
                for sign in [1.0, -1.0] {
                    let (mut x, mut y) = (column as f32, row as f32);
                    let mut last: Option<[f32; 2]> = None;
                    for _ in 0..steps {
                        let d = directions.at(x, y);
                        let flip = match last {
                            None => sign,
                            Some(last) if d[0] * last[0] + d[1] * last[1] < 0.0 => -1.0,
                            Some(_) => 1.0,
                        };
                        let d = d.map(|c| c * flip);
                        last = Some(d);
                        x = (x + d[0]).clamp(0.0, (w - 1) as f32);
                        y = (y + d[1]).clamp(0.0, (h - 1) as f32);
                        sum += bilinear(field, x, y);
                    }
                }
                *out = sum / (2 * steps + 1) as f32;
            }
        });
    out
}

/// Parameters of [`soft_lines`].
#[derive(Clone, Copy)]
pub(crate) struct LineSettings {
    pub sigma: f64,
    pub sharpness: f32,
    pub threshold: f32,
    pub slope: f32,
}

/// Extended difference of Gaussians (Winnemöller 2012): with `D = (1 + p) G_σ∗t − p G_1.6σ∗t`, white where D exceeds
/// the threshold, else `1 + tanh(slope·(D − threshold))`.
pub(crate) fn soft_lines(tone: &Field, settings: LineSettings) -> Field {
    let fine = gaussian(tone, settings.sigma);
    let coarse = gaussian(tone, 1.6 * settings.sigma);
    let p = settings.sharpness;
    let data = fine
        .data()
        .iter()
        .zip(coarse.data())
        .map(|(f, c)| {
            let d = (1.0 + p) * f - p * c;
            if d >= settings.threshold {
                1.0
            } else {
                1.0 + math::tanh(settings.slope * (d - settings.threshold))
            }
        })
        .collect();
    Field::from_vec(tone.width(), tone.height(), data)
}

/// White noise in [0, 1) from the pixel's place alone: the same on any number of threads.
pub(crate) fn grain(width: usize, height: usize, seed: u64) -> Field {
    Field::from_fn(width, height, |x, y| {
        let mut z = ((y as u64) << 32 | x as u64) ^ seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        for factor in [0xbf58_476d_1ce4_e5b9u64, 0x94d0_49bb_1331_11eb, 0xd6e8_feb8_6659_fd93] {
            z = (z ^ (z >> 30)).wrapping_mul(factor);
        }
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    })
}
