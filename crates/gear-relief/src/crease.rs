//! Creases: the hollows that drawn lines stand for.
//!
//! A line that draws form ([`crate::ink::drawn_lines`]) is the bottom of a fold or the gap between two parts. It is cut
//! into the body as a groove of a set width, and *grooves own no low frequency*: what is smooth over large distances
//! is taken away, so the body stays the silhouette's,
//!
//! ```text
//! crease = −depth · (1 − G_scale∗) G_width∗ drawn
//! ```
//!
//! with means over the mask. The height is changed by at most `depth`, whatever is drawn.

use gear_image::filter::gaussian;
use gear_image::{Field, Mask};

use crate::fields::{masked, weighted_gaussian, zip};

/// How lines become creases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CreaseSettings {
    /// Depth of the groove of a wide line, as a share of the longer side; narrow ones are shallower. 0: lines do nothing.
    pub depth: f32,
    /// Width of a groove (σ of its profile), as a share of the longer side.
    pub width: f32,
    /// Largest structure that lines may shape, as a share of the square root of the mask's area.
    pub scale: f32,
}

impl Default for CreaseSettings {
    fn default() -> Self {
        Self {
            depth: 0.09,
            width: 0.01,
            scale: 0.07,
        }
    }
}

/// The creases in pixels, to be added to a height; 0 outside the mask. `None` when nothing is drawn.
pub fn creases(drawn: &Field, mask: &Mask, settings: &CreaseSettings) -> Option<Field> {
    if settings.depth <= 0.0 || drawn.data().iter().all(|&line| line <= 0.0) {
        return None;
    }
    let side = mask.longer_side() as f32;
    let grooves = gaussian(drawn, f64::from(settings.width * side));
    let large = (f64::from(settings.scale) * (mask.count() as f64).sqrt()).max(3.0);
    let mean = weighted_gaussian(&grooves, &mask.to_field(), large);
    let depth = settings.depth * side;
    Some(masked(
        &zip(&grooves, &mean, |groove, mean| depth * (mean - groove)),
        mask,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 96;

    fn line_and_mask() -> (Field, Mask) {
        let mask = Mask::from_fn(SIDE, SIDE, |x, y| (8..88).contains(&x) && (8..88).contains(&y));
        let line = Field::from_fn(SIDE, SIDE, |x, y| f32::from(x == 48 && (30..66).contains(&y)));
        (line, mask)
    }

    #[test]
    fn a_line_is_a_groove_and_the_body_stays() {
        let (line, mask) = line_and_mask();
        let creases = creases(&line, &mask, &CreaseSettings::default()).unwrap();
        assert!(creases.at(48, 48) < -1.0, "{}", creases.at(48, 48));
        assert!(creases.at(20, 20).abs() < 0.01 && creases.at(2, 2) == 0.0);
        let sum: f32 = creases.data().iter().sum();
        let depth: f32 = creases.data().iter().map(|c| c.abs()).sum();
        assert!(sum.abs() < 0.01 * depth, "{sum} of {depth}");
    }

    #[test]
    fn whatever_is_drawn_is_cut_no_deeper_than_told() {
        let (_, mask) = line_and_mask();
        for step in 1..6 {
            let drawn = Field::from_fn(SIDE, SIDE, |x, y| f32::from((x / step + y / step) % 2 == 0));
            let creases = creases(&drawn, &mask, &CreaseSettings::default()).unwrap();
            assert!(creases.data().iter().all(|c| c.abs() <= 0.09 * SIDE as f32));
        }
    }

    #[test]
    fn no_line_or_no_depth_is_no_crease() {
        let (line, mask) = line_and_mask();
        assert!(creases(&Field::filled(SIDE, SIDE, 0.0), &mask, &CreaseSettings::default()).is_none());
        let none = CreaseSettings {
            depth: 0.0,
            ..CreaseSettings::default()
        };
        assert!(creases(&line, &mask, &none).is_none());
    }
}
