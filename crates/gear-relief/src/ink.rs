//! Ink: drawn lines, told from tone steps by being darker than both their sides.
//!
//! `ink = clamp( (max_d min(ℓ(p+d), ℓ(p−d)) − ℓ(p) − floor) / t, 0, 1 )`, with `ℓ = log L` and d in four directions at a fixed
//! distance. A step of tone or of chroma is darker than one side only and gives 0: cloth of several colours is
//! not creased by its pattern.

use gear_image::filter::gaussian;
use gear_image::{Field, LinearImage, Mask, math};

use crate::fields::{depth_inside, map, weighted_gaussian, zip};

/// How lines are told from tone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InkSettings {
    /// Distance of the two sides, as a share of the longer side; at least 2 px.
    pub distance: f32,
    /// Difference of log luminance up to which a line is brushwork or the dark side of a bulge, not ink.
    pub floor: f32,
    /// Difference of log luminance above `floor` at which a line counts fully.
    pub contrast: f32,
    /// Difference of chromaticity between a line and its nearer side at which it is paint of another colour, not ink
    /// or a hollow: those take light away and leave the colour.
    pub chroma: f32,
    /// Share of a neighbourhood that lines may fill before they are ornament.
    pub crowd: f32,
    /// Size of that neighbourhood (σ of a Gaussian), as a share of the longer side.
    pub neighbourhood: f32,
    /// Width of the band inside the silhouette whose lines are its outline, no crease, as a share of the longer
    /// side; at least 4 px.
    pub outline: f32,
}

impl Default for InkSettings {
    fn default() -> Self {
        Self {
            distance: 0.012,
            floor: 0.2,
            contrast: 0.5,
            chroma: 0.06,
            crowd: 0.14,
            neighbourhood: 0.06,
            outline: 0.02,
        }
    }
}

/// Strength of ink at every pixel, in [0, 1]; 0 outside the mask and in the outline band.
pub fn ink_lines(image: &LinearImage, mask: &Mask, settings: &InkSettings) -> Field {
    within(&two_sided_darkness(&image.luminance(), settings), mask, settings)
}

/// Those of the `lines` of a picture ([`ink_lines`]) that draw form, as far as can be told: they have the colour of
/// what lies beside them, only darker, and stand alone. What has a colour of its own, or fills an area, is ornament.
///
/// ```text
/// drawn = max_d ( darkness_d · exp(−(Δchroma_d/c)²) ) · (1 − G∗lines/crowd)⁺
/// ```
pub fn drawn_lines(image: &LinearImage, lines: &Field, mask: &Mask, settings: &InkSettings) -> Field {
    let chroma = chromaticity(image, 0.7);
    let scale = 1.0 / (settings.chroma * settings.chroma).max(1e-12);
    let apart = |from: Point, to: Point| {
        let mut square = 0.0f32;
        for plane in &chroma {
            let d = plane.at_clamped(from.0, from.1) - plane.at_clamped(to.0, to.1);
            square += d * d;
        }
        square
    };
    let grey = darkness(&image.luminance(), settings, |p, sides| {
        math::exp(-scale * apart(p, sides[0]).min(apart(p, sides[1])))
    });
    let sigma = f64::from(settings.neighbourhood * image.longer_side() as f32);
    let crowd = weighted_gaussian(lines, &mask.to_field(), sigma);
    let alone = zip(&grey, &crowd, |line, crowd| {
        line * (1.0 - crowd / settings.crowd.max(1e-6)).clamp(0.0, 1.0)
    });
    within(&alone, mask, settings)
}

/// Red, green and blue as shares of their sum, smoothed.
pub(crate) fn chromaticity(image: &LinearImage, sigma: f64) -> [Field; 3] {
    let (width, height) = image.size();
    std::array::from_fn(|channel| {
        let shares = image.data().iter().map(|c| c[channel] / (c[0] + c[1] + c[2] + 1e-3));
        gaussian(&Field::from_vec(width, height, shares.collect()), sigma)
    })
}

/// The lines inside the mask and off its outline.
fn within(lines: &Field, mask: &Mask, settings: &InkSettings) -> Field {
    let side = mask.longer_side() as f32;
    let band = (settings.outline * side).max(4.0) as u32;
    let depth = depth_inside(mask);
    let (w, h) = lines.size();
    let kept = lines
        .data()
        .iter()
        .zip(&depth)
        .map(|(&ink, &d)| if d > band { ink } else { 0.0 })
        .collect();
    Field::from_vec(w, h, kept)
}

/// The line measure before any mask.
pub fn two_sided_darkness(luminance: &Field, settings: &InkSettings) -> Field {
    darkness(luminance, settings, |_, _| 1.0)
}

type Point = (isize, isize);

/// The line measure, with a weight of the pixel and its two sides.
fn darkness(luminance: &Field, settings: &InkSettings, weight: impl Fn(Point, [Point; 2]) -> f32) -> Field {
    let (w, h) = luminance.size();
    let log = map(&gaussian(luminance, 0.7), |l| math::ln(l.max(0.0) + 1e-2));
    let d = (settings.distance * luminance.longer_side() as f32).round().max(2.0);
    let (d, oblique) = (d as isize, (0.7 * d).round() as isize);
    let contrast = settings.contrast.max(1e-3);
    Field::from_fn(w, h, |x, y| {
        let (x, y) = (x as isize, y as isize);
        let own = log.at_clamped(x, y);
        let mut best = 0.0f32;
        for (dx, dy) in [(d, 0), (0, d), (oblique, oblique), (-oblique, oblique)] {
            let sides = [(x + dx, y + dy), (x - dx, y - dy)];
            let lighter = log
                .at_clamped(sides[0].0, sides[0].1)
                .min(log.at_clamped(sides[1].0, sides[1].1))
                - own;
            let line = ((lighter - settings.floor) / contrast).clamp(0.0, 1.0);
            if line > best {
                best = best.max(line * weight((x, y), sides));
            }
        }
        best
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gear_image::Rgb;

    fn grey(f: impl Fn(usize) -> f32) -> LinearImage {
        Rgb::from_fn(96, 96, |x, _| [f(x); 3])
    }

    #[test]
    fn a_line_is_ink_and_a_step_is_not() {
        let full = Mask::filled(96, 96, true);
        let line = ink_lines(
            &grey(|x| if x == 48 { 0.05 } else { 0.5 }),
            &full,
            &InkSettings::default(),
        );
        assert!(line.at(48, 48) > 0.9 && line.at(40, 48) == 0.0);
        let step = ink_lines(
            &grey(|x| if x < 48 { 0.05 } else { 0.5 }),
            &full,
            &InkSettings::default(),
        );
        assert!(step.data().iter().all(|&ink| ink < 0.05));
    }

    #[test]
    fn ornament_is_ink_but_no_drawing() {
        let full = Mask::filled(96, 96, true);
        let settings = InkSettings::default();
        let drawn = |picture: &LinearImage| {
            let lines = ink_lines(picture, &full, &settings);
            (
                lines.at(48, 48),
                drawn_lines(picture, &lines, &full, &settings).at(48, 48),
            )
        };
        let alone = grey(|x| if x == 48 { 0.05 } else { 0.5 });
        assert!(drawn(&alone).1 > 0.5, "{:?}", drawn(&alone));
        let blue = Rgb::from_fn(96, 96, |x, _| if x == 48 { [0.01, 0.02, 0.2] } else { [0.5; 3] });
        let (ink, form) = drawn(&blue);
        assert!(ink > 0.9 && form < 0.05, "{ink} {form}");
        let (ink, form) = drawn(&grey(|x| if x % 6 == 0 { 0.05 } else { 0.5 }));
        assert!(ink > 0.9 && form < 0.05, "{ink} {form}");
    }

    #[test]
    fn the_outline_of_the_silhouette_is_no_crease() {
        let mask = Mask::from_fn(96, 96, |x, _| x >= 46);
        let ink = ink_lines(
            &grey(|x| if x == 48 { 0.05 } else { 0.5 }),
            &mask,
            &InkSettings::default(),
        );
        assert!(ink.data().iter().all(|&ink| ink == 0.0));
    }
}
