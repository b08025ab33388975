//! Morphology with the four-neighbour cross, iterated: the structuring element is a diamond.

use rayon::prelude::*;

use crate::{Field, Mask};

/// What the pixels beyond the picture's frame count as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// Inside the mask: a figure that the frame cuts is not eroded there.
    Inside,
    /// Outside the mask (scipy's default).
    Outside,
}

/// One step: a pixel becomes `wins` when it or one of its four neighbours is `wins`.
fn spread(mask: &Mask, wins: bool, beyond: bool) -> Mask {
    let (width, height) = mask.size();
    let mut out = mask.clone();
    if mask.is_empty() {
        return out;
    }
    out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let row = mask.row(y);
        for x in 0..width {
            let left = if x > 0 { row[x - 1] } else { beyond };
            let right = if x + 1 < width { row[x + 1] } else { beyond };
            let above = if y > 0 { mask.at(x, y - 1) } else { beyond };
            let below = if y + 1 < height { mask.at(x, y + 1) } else { beyond };
            if [left, right, above, below].contains(&wins) {
                out[x] = wins;
            }
        }
    });
    out
}

/// Takes off everything within `steps` four-neighbour steps of the outside.
pub fn erode(mask: &Mask, steps: usize, beyond: Beyond) -> Mask {
    (0..steps).fold(mask.clone(), |mask, _| spread(&mask, false, beyond == Beyond::Inside))
}

/// Adds everything within `steps` four-neighbour steps of the inside.
pub fn dilate(mask: &Mask, steps: usize) -> Mask {
    (0..steps).fold(mask.clone(), |mask, _| spread(&mask, true, false))
}

/// Erosion, then dilation: drops what is thinner than 2·`steps`.
pub fn open(mask: &Mask, steps: usize, beyond: Beyond) -> Mask {
    dilate(&erode(mask, steps, beyond), steps)
}

/// Dilation, then erosion: fills gaps thinner than 2·`steps`.
pub fn close(mask: &Mask, steps: usize) -> Mask {
    erode(&dilate(mask, steps), steps, Beyond::Inside)
}

/// Maximum over the 3×3 neighbourhood, `steps` times.
pub fn dilate_field(field: &Field, steps: usize) -> Field {
    let (width, height) = field.size();
    let mut field = field.clone();
    for _ in 0..steps {
        let source = field.clone();
        field
            .data_mut()
            .par_chunks_mut(width.max(1))
            .enumerate()
            .for_each(|(y, out)| {
                for x in 0..width {
                    let mut most = f32::NEG_INFINITY;
                    for row in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                        let near = &source.row(row)[x.saturating_sub(1)..=(x + 1).min(width - 1)];
                        most = near.iter().fold(most, |m, &v| m.max(v));
                    }
                    out[x] = most;
                }
            });
    }
    field
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot() -> Mask {
        Mask::from_fn(9, 9, |x, y| x == 4 && y == 4)
    }

    #[test]
    fn dilating_a_dot_draws_a_diamond_and_eroding_undoes_it() {
        let diamond = dilate(&dot(), 3);
        assert_eq!(diamond.count(), 25);
        assert!(diamond.at(1, 4) && !diamond.at(2, 2));
        assert_eq!(erode(&diamond, 3, Beyond::Outside), dot());
    }

    #[test]
    fn the_frame_erodes_only_when_asked() {
        let full = Mask::filled(6, 4, true);
        assert!(erode(&full, 5, Beyond::Inside).is_full());
        assert_eq!(erode(&full, 1, Beyond::Outside).count(), 8);
    }

    #[test]
    fn opening_drops_specks_and_closing_fills_pinholes() {
        let mut mask = Mask::from_fn(20, 20, |x, y| (5..15).contains(&x) && (5..15).contains(&y));
        mask.set(1, 1, true);
        assert!(!open(&mask, 1, Beyond::Outside).at(1, 1));
        mask.set(9, 9, false);
        assert!(close(&mask, 1).at(9, 9));
    }

    #[test]
    fn a_widened_line_is_three_pixels_wide() {
        let line = Field::from_fn(7, 3, |x, _| if x == 3 { 1.0 } else { 0.0 });
        assert_eq!(dilate_field(&line, 1).row(1), [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    }
}
