//! Stage 3: which Gaussians touch which tile, front to back within each.
//!
//! A counting sort over the depth-sorted Gaussians. Chunks of them find and count their tiles on their own, and then
//! write on their own: chunk c starts writing to a tile's list where the chunks before it end. The chunks depend on
//! the scene only, so that the lists do not depend on the number of threads.
//!
//! A tile that Gaussians cover whole is closed as soon as those of one chunk let less than 1e-4 of the light through at
//! every pixel: what follows in the chunk cannot be seen there. Without this, Gaussians larger than the picture would
//! fill memory with one entry for each tile.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::lanes;
use super::project::Splat;
use super::simd::{SimdLevel, simd_kernels};
use crate::render::{ALPHA_MAX, ALPHA_MIN_LOG2, TRANSMITTANCE_MIN};

/// Tile size in pixels. Rows are short enough that a tile's buffers stay in the first-level cache, wide enough that
/// a surfel seldom falls into two tiles.
pub(crate) const TILE_WIDTH: usize = 32;
/// See [`TILE_WIDTH`].
pub(crate) const TILE_HEIGHT: usize = 16;
/// Rows of a strip, into which crowded tiles are cut.
const STRIP_HEIGHT: usize = 4;
/// A tile is crowded when it has at least this many entries and a sixteenth of all.
const CROWD: usize = 512;
/// Transmittance below which a tile is closed; below [`TRANSMITTANCE_MIN`] by more than rounding.
const CLOSED: f32 = 0.5 * TRANSMITTANCE_MIN;

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

    /// Calls `visit` with every tile that the ellipse α ≥ 1/255 touches, row by row. Where the tiles of its box are a
    /// single row or column they are all taken; the second argument tells that the ellipse is larger than that.
    #[inline(always)]
    fn for_each_tile(&self, splat: &Splat, mut visit: impl FnMut(usize, bool)) {
        let Some((left, right)) = pixels(splat.mean[0], splat.half[0], self.width) else {
            return;
        };
        let Some((top, bottom)) = pixels(splat.mean[1], splat.half[1], self.height) else {
            return;
        };
        let (left, right) = (left / TILE_WIDTH, right / TILE_WIDTH);
        let (top, bottom) = (top / TILE_HEIGHT, bottom / TILE_HEIGHT);
        if left == right || top == bottom {
            for row in top..=bottom {
                for column in left..=right {
                    visit(row * self.columns + column, false);
                }
            }
            return;
        }
        for row in top..=bottom {
            // The ellipse between the first and the last pixel row of this tile row.
            let low = (row * TILE_HEIGHT) as f32 - splat.mean[1];
            let high = low + (TILE_HEIGHT - 1) as f32;
            let (first, last) = horizontal_extent(splat, low, high);
            let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
            if let Some((first, last)) = pixels(splat.mean[0] + middle, half, self.width) {
                for column in first / TILE_WIDTH..=last / TILE_WIDTH {
                    visit(row * self.columns + column, true);
                }
            }
        }
    }

    /// The smallest α of a splat within a tile, zero where it is below 1/255: log α is concave, so that the corners
    /// decide.
    fn least_alpha(&self, splat: &Splat, tile: usize) -> f32 {
        let left = (tile % self.columns * TILE_WIDTH) as f32 - splat.mean[0];
        let top = (tile / self.columns * TILE_HEIGHT) as f32 - splat.mean[1];
        let mut least = f32::INFINITY;
        for y in [top, top + (TILE_HEIGHT - 1) as f32] {
            for x in [left, left + (TILE_WIDTH - 1) as f32] {
                let along = x - splat.shear * y;
                let here = splat.peak - splat.precision_x * (along * along) - splat.precision_y * (y * y);
                least = if here < least { here } else { least };
            }
        }
        // Rounding must not close a tile that the blend would still draw into.
        let least = least - 1e-3 * (1.0 + least.abs());
        if least >= ALPHA_MIN_LOG2 {
            lanes::exp2_nonpositive(least).min(ALPHA_MAX)
        } else {
            0.0
        }
    }
}

/// The integers within `half` of `middle` that are pixels of a side.
#[inline(always)]
fn pixels(middle: f32, half: f32, side: usize) -> Option<(usize, usize)> {
    // A little slack: the span of each row is exact.
    let low = (middle - half - 1e-3).max(0.0);
    let high = (middle + half + 1e-3).min(side as f32 - 1.0);
    // The truncation of `low` may take in the pixel before it.
    (low <= high).then_some((low as usize, high as usize))
}

/// Left- and rightmost x − mx of the ellipse within low ≤ y − my ≤ high.
#[inline(always)]
fn horizontal_extent(splat: &Splat, low: f32, high: f32) -> (f32, f32) {
    let [half_x, half_y] = splat.half;
    let (low, high) = (low.max(-half_y), high.min(half_y));
    // The rightmost point lies at y = half_y · (Σxy/Σyy) · (half_y/half_x), the leftmost opposite.
    let y_right = half_y * (splat.shear * (half_y / half_x));
    let edge = |y: f32, side: f32| {
        let y = y.max(low).min(high);
        let rest = (splat.peak - ALPHA_MIN_LOG2 - splat.precision_y * y * y).max(0.0);
        splat.shear * y + side * splat.sigma_x * rest.sqrt()
    };
    (edge(-y_right, -1.0), edge(y_right, 1.0))
}

/// Lists of Gaussians by tile.
pub(crate) struct Bins {
    pub grid: Grid,
    /// `entries[starts[t]..starts[t + 1]]` is tile t's list.
    starts: Vec<usize>,
    /// Gaussians by rank in depth, front to back within a tile.
    entries: Vec<u32>,
}

/// The tiles of a chunk's splats.
#[derive(Default)]
struct Touched {
    /// Tiles, splat by splat.
    tiles: Vec<u32>,
    /// Where each splat's tiles end.
    ends: Vec<u32>,
    /// How many splats touch each tile; then the place that the next one takes in the tile's list.
    counts: Vec<u32>,
}

simd_kernels! {
    fn touch(grid: &Grid, splats: &[Splat], out: &mut Touched) {
        // Empty until a splat is large: most scenes have none.
        let mut light: Vec<f32> = Vec::new();
        for splat in splats {
            grid.for_each_tile(splat, |tile, large| {
                if large && light.is_empty() {
                    light = vec![1.0; grid.columns * grid.rows];
                }
                if let Some(light) = light.get_mut(tile) {
                    if *light < CLOSED {
                        return;
                    }
                    if large {
                        *light *= 1.0 - grid.least_alpha(splat, tile);
                    }
                }
                out.tiles.push(tile as u32);
                out.counts[tile] += 1;
            });
            out.ends.push(out.tiles.len() as u32);
        }
    }
}

impl Bins {
    /// `splats`: front to back.
    pub fn new(grid: Grid, splats: &[Splat], level: SimdLevel) -> Self {
        let tiles = grid.columns * grid.rows;
        let chunk = splats.len().div_ceil(16).max(2048);
        let mut touched: Vec<Touched> = splats
            .par_chunks(chunk)
            .map(|part| {
                let mut out = Touched {
                    tiles: Vec::with_capacity(2 * part.len()),
                    ends: Vec::with_capacity(part.len()),
                    counts: vec![0; tiles],
                };
                touch(level, &grid, part, &mut out);
                out
            })
            .collect();

        let mut starts = Vec::with_capacity(tiles + 1);
        let mut total = 0;
        for tile in 0..tiles {
            starts.push(total);
            let mut here = 0;
            for chunk in &mut touched {
                let count = chunk.counts[tile];
                chunk.counts[tile] = here;
                here += count;
            }
            total += here as usize;
        }
        starts.push(total);

        // Every place is written once, by the chunk that counted it; relaxed atomics only make that safe to say.
        let entries: Vec<AtomicU32> = (0..total).map(|_| AtomicU32::new(0)).collect();
        touched.par_iter_mut().enumerate().for_each(|(c, touched)| {
            let mut from = 0;
            for (k, &end) in touched.ends.iter().enumerate() {
                for &tile in &touched.tiles[from..end as usize] {
                    let place = &mut touched.counts[tile as usize];
                    entries[starts[tile as usize] + *place as usize].store((c * chunk + k) as u32, Ordering::Relaxed);
                    *place += 1;
                }
                from = end as usize;
            }
        });
        let entries = entries.into_iter().map(AtomicU32::into_inner).collect();
        Self { grid, starts, entries }
    }

    /// The list of one tile.
    pub fn tile(&self, tile: usize) -> &[u32] {
        &self.entries[self.starts[tile]..self.starts[tile + 1]]
    }

    /// Number of (tile, Gaussian) pairs.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// The row ranges into which a tile is cut, so that all threads are busy when one tile holds much of the scene. They
    /// depend on the scene only.
    pub fn strips(&self, tile: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let rows = TILE_HEIGHT.min(self.grid.height - tile / self.grid.columns * TILE_HEIGHT);
        let here = self.tile(tile).len();
        let crowded = here >= CROWD && here * 16 >= self.len();
        let step = if crowded { STRIP_HEIGHT } else { TILE_HEIGHT };
        (0..rows)
            .step_by(step)
            .map(move |first| (first, rows.min(first + step)))
    }
}
