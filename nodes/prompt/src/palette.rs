//! The palette of a painting: its most frequent colours, named as painters name them.
//!
//! Every pixel goes to the nearest of a list of named colours, in the cube roots of linear light, where distances are
//! roughly what eyes see. Deterministic, and one pass: names are what is wanted, not centres of clusters.

use gear_image::{Mask, SrgbImage, colour, math};

/// A colour of a palette.
#[derive(Clone, Debug, PartialEq)]
pub struct Colour {
    pub name: &'static str,
    /// Share of the pixels that count.
    pub share: f64,
    /// Mean of its pixels, encoded, three decimals.
    pub srgb: [f64; 3],
}

/// Names of pigments and grounds, and what they look like in sRGB codes.
const NAMES: [(&str, [u8; 3]); 24] = [
    ("ink black", [25, 22, 22]),
    ("charcoal grey", [72, 70, 70]),
    ("stone grey", [130, 128, 124]),
    ("silver grey", [185, 184, 180]),
    ("chalk white", [250, 249, 245]),
    ("ivory", [243, 233, 208]),
    ("aged silk", [205, 185, 148]),
    ("ochre", [198, 148, 72]),
    ("gold", [220, 178, 70]),
    ("raw umber", [115, 85, 55]),
    ("burnt umber", [72, 46, 34]),
    ("sienna", [155, 88, 48]),
    ("vermilion", [204, 60, 38]),
    ("crimson", [145, 28, 42]),
    ("rose", [222, 150, 150]),
    ("orange", [228, 122, 40]),
    ("lead-tin yellow", [240, 212, 90]),
    ("malachite green", [70, 140, 95]),
    ("dark green", [40, 72, 50]),
    ("pale green", [160, 190, 150]),
    ("lapis blue", [38, 62, 140]),
    ("indigo", [34, 42, 72]),
    ("azurite blue", [84, 130, 180]),
    ("violet", [110, 70, 120]),
];

fn perceived(srgb: [f32; 3]) -> [f32; 3] {
    let mut light = srgb.map(|c| colour::to_linear(if c.is_finite() { c.clamp(0.0, 1.0) } else { 0.0 }));
    math::cbrt_slice(&mut light);
    light
}

/// The most frequent colours, at most `count`, most frequent first; those of less than one pixel in a hundred are left out.
pub fn of(picture: &SrgbImage, mask: Option<&Mask>, count: usize) -> Vec<Colour> {
    let names = NAMES.map(|(_, code)| perceived(code.map(|c| f32::from(c) / 255.0)));
    let mut pixels = [0usize; NAMES.len()];
    let mut sums = [[0.0f64; 3]; NAMES.len()];
    // A mask of another size says nothing about these pixels.
    let mask = mask.filter(|mask| mask.size() == picture.size() && mask.count() > 0);
    for (i, pixel) in picture.data().iter().enumerate() {
        if mask.is_some_and(|mask| !mask.data()[i]) {
            continue;
        }
        let seen = perceived(*pixel);
        let distance = |name: &[f32; 3]| -> f32 { (0..3).map(|c| (name[c] - seen[c]) * (name[c] - seen[c])).sum() };
        let nearest = (0..names.len()).min_by(|a, b| distance(&names[*a]).total_cmp(&distance(&names[*b])));
        let nearest = nearest.unwrap_or(0);
        pixels[nearest] += 1;
        for (sum, value) in sums[nearest].iter_mut().zip(pixel) {
            *sum += if value.is_finite() {
                f64::from(value.clamp(0.0, 1.0))
            } else {
                0.0
            };
        }
    }
    let total: usize = pixels.iter().sum();
    let mut order: Vec<usize> = (0..NAMES.len()).filter(|i| pixels[*i] * 100 > total).collect();
    order.sort_by_key(|i| (std::cmp::Reverse(pixels[*i]), *i));
    order.truncate(count);
    let rounded = |x: f64| (x * 1000.0).round() / 1000.0;
    order
        .into_iter()
        .map(|i| Colour {
            name: NAMES[i].0,
            share: rounded(pixels[i] as f64 / total as f64),
            srgb: sums[i].map(|sum| rounded(sum / pixels[i] as f64)),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_its_own() {
        for (name, code) in NAMES {
            let picture = SrgbImage::filled(3, 3, code.map(|c| f32::from(c) / 255.0));
            assert_eq!(of(&picture, None, 5)[0].name, name);
        }
    }

    #[test]
    fn the_mask_says_what_counts() {
        let picture = SrgbImage::from_fn(
            10,
            10,
            |x, _| if x < 3 { [0.14, 0.24, 0.55] } else { [0.95, 0.92, 0.82] },
        );
        let mask = Mask::from_fn(10, 10, |x, _| x < 3);
        assert_eq!(of(&picture, Some(&mask), 5).len(), 1);
        assert_eq!(of(&picture, Some(&mask), 5)[0].name, "lapis blue");
        assert_eq!(of(&picture, None, 1)[0].name, "ivory");
        assert_eq!(of(&picture, None, 0), []);
        assert_eq!(of(&SrgbImage::filled(0, 0, [0.0; 3]), None, 5), []);
    }
}
