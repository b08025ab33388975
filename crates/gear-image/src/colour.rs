//! Colour: the sRGB transfer functions (IEC 61966-2-1), luminance, and the cleaning of bad samples.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::{Field, Linear, LinearImage, Rgb, Space, Srgb, SrgbImage, math};

/// Luminance weights of linear sRGB (Rec. 709 primaries).
pub const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// What a positive infinite sample becomes.
pub const BRIGHTEST: f32 = 1e30;

/// Encoded value to linear light. Odd; above 1 the power branch continues.
///
/// a^2.4 is taken as a²·a^0.4, which keeps the error near one ulp.
#[inline(always)]
pub fn to_linear(encoded: f32) -> f32 {
    let c = encoded.abs();
    let a = (c + 0.055) * (1.0 / 1.055);
    let power = a * a * math::exp(0.4 * math::ln(a));
    let y = if c <= 0.04045 { c * (1.0 / 12.92) } else { power };
    y.copysign(encoded)
}

/// Linear light to encoded value. Odd; above 1 the power branch continues.
#[inline(always)]
pub fn to_srgb(linear: f32) -> f32 {
    let y = linear.abs();
    // Below the toe the logarithm is not used; the guard only keeps it off zero.
    let safe = if y < 1e-6 { 1e-6 } else { y };
    let power = 1.055 * math::exp(math::ln(safe) * (1.0 / 2.4)) - 0.055;
    let c = if y <= 0.003_130_8 { y * 12.92 } else { power };
    c.copysign(linear)
}

/// Luminance of linear light.
#[inline(always)]
pub fn luminance(linear: [f32; 3]) -> f32 {
    LUMA[0] * linear[0] + LUMA[1] * linear[1] + LUMA[2] * linear[2]
}

/// Replaces every encoded value by its linear light.
#[multiversion(targets = "simd")]
pub fn to_linear_slice(xs: &mut [f32]) {
    for x in xs {
        *x = to_linear(*x);
    }
}

/// Replaces every linear value by its sRGB encoding.
#[multiversion(targets = "simd")]
pub fn to_srgb_slice(xs: &mut [f32]) {
    for x in xs {
        *x = to_srgb(*x);
    }
}

/// Decodes encoded colour to light that is finite and non-negative (see [`sanitise_sample`]): what nodes start
/// from.
pub fn light(image: &SrgbImage) -> LinearImage {
    convert::<Srgb, Linear>(image, light_slice)
}

/// Replaces every encoded value by its light, finite and non-negative.
#[multiversion(targets = "simd")]
pub fn light_slice(xs: &mut [f32]) {
    for x in xs {
        *x = sanitise_sample(to_linear(*x));
    }
}

fn convert<A: Space, B: Space>(image: &Rgb<A>, f: impl Fn(&mut [f32]) + Sync + Send) -> Rgb<B> {
    let mut data = image.data().to_vec();
    data.par_chunks_mut(1 << 13)
        .for_each(|chunk| f(chunk.as_flattened_mut()));
    Rgb::from_vec(image.width(), image.height(), data)
}

impl SrgbImage {
    /// Decodes to linear light.
    pub fn to_linear(&self) -> LinearImage {
        convert::<Srgb, Linear>(self, to_linear_slice)
    }
}

impl LinearImage {
    /// Encodes with the sRGB transfer function.
    pub fn to_srgb(&self) -> SrgbImage {
        convert::<Linear, Srgb>(self, to_srgb_slice)
    }

    /// Luminance of every pixel.
    pub fn luminance(&self) -> Field {
        let mut out = Field::filled(self.width(), self.height(), 0.0);
        out.data_mut()
            .par_chunks_mut(1 << 13)
            .zip(self.data().par_chunks(1 << 13))
            .for_each(|(out, rgb)| {
                for (out, &rgb) in out.iter_mut().zip(rgb) {
                    *out = luminance(rgb);
                }
            });
        out
    }
}

/// How many pixels [`sanitise`] changed, by cause. A pixel with several bad samples counts once, by the first
/// cause in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sanitised {
    /// Pixels with a NaN, now 0.
    pub nan: usize,
    /// Pixels with an infinity, now [`BRIGHTEST`] or, if negative, 0.
    pub infinite: usize,
    /// Pixels with a negative sample, now 0.
    pub negative: usize,
}

impl Sanitised {
    /// Pixels changed for any cause.
    pub fn total(&self) -> usize {
        self.nan + self.infinite + self.negative
    }
}

/// One sample made finite and non-negative: NaN → 0, −∞ → 0, +∞ → [`BRIGHTEST`], negatives → 0.
#[inline(always)]
pub fn sanitise_sample(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 }; // NaN compares false
    if x > BRIGHTEST { BRIGHTEST } else { x }
}

/// Makes every sample finite and non-negative (see [`sanitise_sample`]) and counts the pixels changed.
pub fn sanitise(pixels: &mut [[f32; 3]]) -> Sanitised {
    let parts: Vec<Sanitised> = pixels
        .par_chunks_mut(1 << 13)
        .map(|chunk| {
            let mut count = Sanitised::default();
            for pixel in chunk {
                if pixel.iter().any(|x| x.is_nan()) {
                    count.nan += 1;
                } else if pixel.iter().any(|x| x.is_infinite()) {
                    count.infinite += 1;
                } else if pixel.iter().any(|&x| x < 0.0) {
                    count.negative += 1;
                }
                *pixel = pixel.map(sanitise_sample);
            }
            count
        })
        .collect();
    parts.iter().fold(Sanitised::default(), |a, b| Sanitised {
        nan: a.nan + b.nan,
        infinite: a.infinite + b.infinite,
        negative: a.negative + b.negative,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact_linear(c: f64) -> f64 {
        if c <= 0.04045 {
            c / 12.92
        } else {
            libm::pow((c + 0.055) / 1.055, 2.4)
        }
    }

    fn exact_srgb(y: f64) -> f64 {
        if y <= 0.003_130_8 {
            y * 12.92
        } else {
            1.055 * libm::pow(y, 1.0 / 2.4) - 0.055
        }
    }

    #[test]
    fn transfer_functions_are_the_standard_to_f32() {
        for i in 0..=100_000 {
            let x = i as f32 / 50_000.0;
            let exact = exact_linear(f64::from(x));
            assert!(
                (f64::from(to_linear(x)) - exact).abs() <= 6e-7 * exact + 1e-9,
                "to_linear({x})"
            );
            let exact = exact_srgb(f64::from(x));
            assert!(
                (f64::from(to_srgb(x)) - exact).abs() <= 5e-7 * exact + 1e-9,
                "to_srgb({x})"
            );
        }
    }

    #[test]
    fn every_8_and_16_bit_code_survives_the_round_trip() {
        for code in 0..=65_535u32 {
            let x = code as f32 / 65_535.0;
            assert_eq!((to_srgb(to_linear(x)) * 65_535.0).round() as u32, code);
        }
        assert_eq!(to_linear(-0.5), -to_linear(0.5));
        assert!(to_linear(to_srgb(1e30)) > 0.99e30);
    }

    #[test]
    fn bad_samples_are_replaced_and_their_pixels_counted() {
        let mut pixels = [
            [f32::NAN, -1.0, 0.5],
            [f32::INFINITY, 0.1, 0.2],
            [f32::NEG_INFINITY, 0.1, 0.2],
            [-0.1, 0.1, 0.2],
            [0.3, 0.1, 0.2],
        ];
        let count = sanitise(&mut pixels);
        assert_eq!(
            count,
            Sanitised {
                nan: 1,
                infinite: 2,
                negative: 1
            }
        );
        assert_eq!(pixels[0], [0.0, 0.0, 0.5]);
        assert_eq!(pixels[1][0], BRIGHTEST);
        assert_eq!(pixels[2][0], 0.0);
        assert_eq!(pixels[4], [0.3, 0.1, 0.2]);
    }
}
