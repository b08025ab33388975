//! The colour space in which figure and ground are told apart: cube roots of cone-like responses (Oklab), in
//! which equal distances look about equally different.

use gear_image::filter::gaussian_rgb;
use gear_image::filter::resize_rgb;
use gear_image::{SrgbImage, math};
use rayon::prelude::*;

/// A colour: lightness, green–red, blue–yellow. Lightness counts less than hue: paper darkens with age and a
/// figure is modelled, but neither changes its pigment much.
pub type Feature = [f32; 3];

/// Weight of lightness against the two colour axes.
const LIGHTNESS: f32 = 0.7;

/// A picture of features, row-major.
pub struct Features {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major.
    pub data: Vec<Feature>,
}

impl Features {
    /// Features of `image` resized to `width` × `height` and smoothed by `sigma` pixels.
    pub fn new(image: &SrgbImage, width: usize, height: usize, sigma: f64) -> Self {
        let mut linear = image.to_linear();
        for value in linear.data_mut().iter_mut().flatten() {
            *value = if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 };
        }
        if linear.size() != (width, height) {
            linear = resize_rgb(&linear, width, height);
        }
        let smooth = gaussian_rgb(&linear, sigma);
        Self {
            width,
            height,
            data: smooth.data().par_iter().map(|rgb| feature(*rgb)).collect(),
        }
    }
}

/// Oklab (Ottosson 2020) with weighted lightness.
pub fn feature([r, g, b]: [f32; 3]) -> Feature {
    let l = math::cbrt(0.412_221_46 * r + 0.536_332_55 * g + 0.051_445_995 * b);
    let m = math::cbrt(0.211_903_5 * r + 0.680_699_5 * g + 0.107_396_96 * b);
    let s = math::cbrt(0.088_302_46 * r + 0.281_718_85 * g + 0.629_978_7 * b);
    [
        LIGHTNESS * (0.210_454_26 * l + 0.793_617_8 * m - 0.004_072_047 * s),
        1.977_998_5 * l - 2.428_592_2 * m + 0.450_593_7 * s,
        0.025_904_037 * l + 0.782_771_77 * m - 0.808_675_77 * s,
    ]
}

/// Squared distance of two features.
#[inline]
pub fn squared_distance(a: Feature, b: Feature) -> f32 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greys_have_no_hue_and_white_is_brightest() {
        for v in [0.0, 0.1, 0.5, 1.0] {
            let [l, a, b] = feature([v, v, v]);
            assert!(a.abs() < 1e-3 && b.abs() < 1e-3);
            assert!((l - LIGHTNESS * math::cbrt(v)).abs() < 1e-3);
        }
    }
}
