//! Ink: drawn lines, told from tone steps by being darker than both their sides.
//!
//! `ink = clamp( (max_d min(ℓ(p+d), ℓ(p−d)) − ℓ(p) − floor) / t, 0, 1 )`, with `ℓ = log L` and d in four directions at a fixed
//! distance. A step of tone or of chroma is darker than one side only and gives 0: cloth of several colours is
//! not creased by its pattern.

use gear_image::filter::gaussian;
use gear_image::{Field, LinearImage, Mask, math};

use crate::fields::{depth_inside, map};

/// How lines are told from tone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InkSettings {
    /// Distance of the two sides, as a share of the longer side; at least 2 px.
    pub distance: f32,
    /// Difference of log luminance up to which a line is brushwork or the dark side of a bulge, not ink.
    pub floor: f32,
    /// Difference of log luminance above `floor` at which a line counts fully.
    pub contrast: f32,
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
            outline: 0.02,
        }
    }
}

/// Strength of ink at every pixel, in [0, 1]; 0 outside the mask and in the outline band.
pub fn ink_lines(image: &LinearImage, mask: &Mask, settings: &InkSettings) -> Field {
    let lines = two_sided_darkness(&image.luminance(), settings);
    let side = image.longer_side() as f32;
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
            let sides = log.at_clamped(x + dx, y + dy).min(log.at_clamped(x - dx, y - dy));
            best = best.max(sides - own);
        }
        ((best - settings.floor) / contrast).clamp(0.0, 1.0)
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
