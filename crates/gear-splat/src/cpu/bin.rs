//! Stage 3: which Gaussians touch which tile, front to back within each.
//!
//! A counting sort in two passes over the depth-sorted Gaussians. Both passes run in chunks that count, and later
//! write, on their own: chunk c starts writing to a tile where the chunks before it end, so that the lists do not
//! depend on how many chunks there are.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::project::Splat;

/// Tile size in pixels. Rows are short enough that a tile's buffers stay in the first-level cache, wide enough that
/// a surfel seldom falls into two tiles.
pub(crate) const TILE_WIDTH: usize = 32;
/// See [`TILE_WIDTH`].
pub(crate) const TILE_HEIGHT: usize = 16;

/// The tiles of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub width: usize,
    pub height: usize,
    pub columns: usize,
    pub rows: usize,
}

impl Grid {
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            columns: width.div_ceil(TILE_WIDTH),
            rows: height.div_ceil(TILE_HEIGHT),
        }
    }

    /// Calls `visit` with every tile that the splat's ellipse q ≤ cutoff touches, row by row.
    fn for_each_tile(&self, splat: &Splat, mut visit: impl FnMut(usize)) {
        let sigma_y = 1.0 / splat.precision_y.sqrt();
        let half_y = splat.cutoff.sqrt() * sigma_y;
        let Some((top, bottom)) = pixels(splat.mean[1] - half_y, splat.mean[1] + half_y, self.height) else {
            return;
        };
        for row in top / TILE_HEIGHT..=bottom / TILE_HEIGHT {
            // The ellipse between the first and the last pixel row of this tile row.
            let low = (row * TILE_HEIGHT) as f32 - splat.mean[1];
            let high = low + (TILE_HEIGHT - 1) as f32;
            let (left, right) = horizontal_extent(splat, sigma_y, half_y, low, high);
            if let Some((left, right)) = pixels(splat.mean[0] + left, splat.mean[0] + right, self.width) {
                for column in left / TILE_WIDTH..=right / TILE_WIDTH {
                    visit(row * self.columns + column);
                }
            }
        }
    }
}

/// The integers in [low, high] that are pixels of a side.
fn pixels(low: f32, high: f32, side: usize) -> Option<(usize, usize)> {
    // A little slack: the span of each row is tested again, pixel by pixel.
    let low = (low - 1e-3).ceil().max(0.0);
    let high = (high + 1e-3).floor().min(side as f32 - 1.0);
    (low <= high).then_some((low as usize, high as usize))
}

/// Left- and rightmost x − mx of the ellipse within low ≤ y − my ≤ high.
fn horizontal_extent(splat: &Splat, sigma_y: f32, half_y: f32, low: f32, high: f32) -> (f32, f32) {
    let (low, high) = (low.max(-half_y), high.min(half_y));
    // Σxx = σ_x² + shear²·Σyy; the rightmost point lies at y = Σxy·√(cutoff/Σxx), the leftmost opposite.
    let drift = splat.shear * sigma_y;
    let total = (splat.sigma_x * splat.sigma_x + drift * drift).sqrt();
    let y_right = if total > 0.0 { half_y * (drift / total) } else { 0.0 };
    let edge = |y: f32, side: f32| {
        let y = y.max(low).min(high);
        let rest = (splat.cutoff - splat.precision_y * y * y).max(0.0);
        splat.shear * y + side * splat.sigma_x * rest.sqrt()
    };
    (edge(-y_right, -1.0), edge(y_right, 1.0))
}

/// Lists of Gaussians by tile.
pub(crate) struct Bins {
    pub grid: Grid,
    /// `entries[starts[t]..starts[t + 1]]` is tile t's list.
    pub starts: Vec<usize>,
    /// Gaussians, front to back within a tile.
    pub entries: Vec<u32>,
}

impl Bins {
    /// `order`: the seen Gaussians, front to back.
    pub fn new(grid: Grid, splats: &[Splat], order: &[u32]) -> Self {
        let tiles = grid.columns * grid.rows;
        let chunk = order.len().div_ceil(16).max(8192);
        let mut cursors: Vec<Vec<u32>> = order
            .par_chunks(chunk)
            .map(|part| {
                let mut counts = vec![0u32; tiles];
                for &i in part {
                    grid.for_each_tile(&splats[i as usize], |tile| counts[tile] += 1);
                }
                counts
            })
            .collect();

        let mut starts = Vec::with_capacity(tiles + 1);
        let mut total = 0u32;
        for tile in 0..tiles {
            starts.push(total as usize);
            for counts in &mut cursors {
                let count = counts[tile];
                counts[tile] = total;
                total += count;
            }
        }
        starts.push(total as usize);

        // Every place is written once, by the chunk that counted it; relaxed atomics only make that safe to say.
        let entries: Vec<AtomicU32> = std::iter::repeat_with(AtomicU32::default)
            .take(total as usize)
            .collect();
        order
            .par_chunks(chunk)
            .zip(cursors.par_iter_mut())
            .for_each(|(part, cursor)| {
                for &i in part {
                    grid.for_each_tile(&splats[i as usize], |tile| {
                        entries[cursor[tile] as usize].store(i, Ordering::Relaxed);
                        cursor[tile] += 1;
                    });
                }
            });
        let entries = entries.into_iter().map(AtomicU32::into_inner).collect();
        Self { grid, starts, entries }
    }

    /// The list of one tile.
    pub fn tile(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile]..self.starts[tile + 1]]
    }
}
