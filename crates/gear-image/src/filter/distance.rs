//! Exact Euclidean distance to a mask, and which of its pixels is nearest.
//!
//! Meijster's two passes, in integers: along columns the nearest inside row; along each row the lower envelope
//! of the parabolas (x − i)² + d_i².

use rayon::prelude::*;

use crate::{Field, Mask};

/// For every pixel, the nearest inside pixel of a mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nearest {
    width: usize,
    /// Row-major index of the nearest inside pixel.
    pub index: Vec<u32>,
}

impl Nearest {
    /// (x, y) of the inside pixel nearest to (x, y).
    pub fn at(&self, x: usize, y: usize) -> (usize, usize) {
        let index = self.index[y * self.width + x] as usize;
        (index % self.width, index / self.width)
    }

    /// Squared distance from (x, y) to it, in pixels².
    pub fn squared_distance(&self, x: usize, y: usize) -> u64 {
        let (nx, ny) = self.at(x, y);
        (nx.abs_diff(x) as u64).pow(2) + (ny.abs_diff(y) as u64).pow(2)
    }
}

/// The inside pixel of `mask` nearest to every pixel; `None` when the mask is empty.
pub fn nearest(mask: &Mask) -> Option<Nearest> {
    let (width, height) = mask.size();
    if mask.count() == 0 {
        return None;
    }
    // Nearest inside row per pixel, along its column.
    const NONE: u32 = u32::MAX;
    let mut rows = vec![NONE; mask.len()];
    for y in 0..height {
        for x in 0..width {
            let above = if y > 0 { rows[(y - 1) * width + x] } else { NONE };
            rows[y * width + x] = if mask.at(x, y) { y as u32 } else { above };
        }
    }
    for y in (0..height.saturating_sub(1)).rev() {
        for x in 0..width {
            let (here, below) = (rows[y * width + x], rows[(y + 1) * width + x]);
            if below != NONE && (here == NONE || below.abs_diff(y as u32) < here.abs_diff(y as u32)) {
                rows[y * width + x] = below;
            }
        }
    }
    let mut index = vec![0u32; mask.len()];
    index
        .par_chunks_mut(width)
        .zip(rows.par_chunks(width))
        .enumerate()
        .for_each_init(Vec::new, |hull: &mut Vec<(i64, i64)>, (y, (out, rows))| {
            envelope(y, rows, out, width, hull)
        });
    Some(Nearest { width, index })
}

/// One row: `hull` holds (column i, first x at which its parabola is lowest).
fn envelope(y: usize, rows: &[u32], out: &mut [u32], width: usize, hull: &mut Vec<(i64, i64)>) {
    let height2 = |i: i64| (rows[i as usize] as i64 - y as i64).pow(2);
    let value = |x: i64, i: i64| (x - i).pow(2) + height2(i);
    hull.clear();
    for u in 0..width as i64 {
        if rows[u as usize] == u32::MAX {
            continue;
        }
        while let Some(&(i, from)) = hull.last() {
            if value(from, i) > value(from, u) {
                hull.pop();
            } else {
                break;
            }
        }
        match hull.last() {
            None => hull.push((u, 0)),
            Some(&(i, _)) => {
                let from = 1 + (u * u - i * i + height2(u) - height2(i)).div_euclid(2 * (u - i));
                if from < width as i64 {
                    hull.push((u, from));
                }
            }
        }
    }
    let mut at = hull.len();
    for x in (0..width as i64).rev() {
        while hull[at - 1].1 > x {
            at -= 1;
        }
        let i = hull[at - 1].0;
        out[x as usize] = rows[i as usize] * width as u32 + i as u32;
    }
}

/// Euclidean distance in pixels from every pixel to the inside of `mask`, 0 inside; infinite when it is empty.
pub fn distance_to(mask: &Mask) -> Field {
    let (width, height) = mask.size();
    match nearest(mask) {
        None => Field::filled(width, height, f32::INFINITY),
        Some(map) => Field::from_fn(width, height, |x, y| (map.squared_distance(x, y) as f32).sqrt()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_looking_at_every_pixel(w in 1usize..24, h in 1usize..24, seed in 0usize..1000) {
            let mask = Mask::from_fn(w, h, |x, y| (x * 7919 + y * 104_729 + seed * 31 + x * y) % 11 == 0);
            let map = nearest(&mask);
            prop_assert_eq!(map.is_some(), mask.count() > 0);
            if let Some(map) = map {
                for y in 0..h {
                    for x in 0..w {
                        let (nx, ny) = map.at(x, y);
                        prop_assert!(mask.at(nx, ny));
                        let best = (0..w * h)
                            .filter(|&i| mask.data()[i])
                            .map(|i| ((i % w).abs_diff(x).pow(2) + (i / w).abs_diff(y).pow(2)) as u64)
                            .min();
                        prop_assert_eq!(Some(map.squared_distance(x, y)), best);
                    }
                }
            }
        }
    }

    #[test]
    fn an_empty_mask_is_infinitely_far() {
        assert!(
            distance_to(&Mask::filled(3, 2, false))
                .data()
                .iter()
                .all(|d| d.is_infinite())
        );
        assert_eq!(distance_to(&Mask::from_fn(5, 5, |x, y| x == 0 && y == 0)).at(3, 4), 5.0);
    }
}
