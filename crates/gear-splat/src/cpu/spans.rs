//! Row spans: which pixels of a tile an ellipse covers, solved exactly for each row.
//!
//! In a row the exponent y(x) = base − precision·(x − middle)² is a parabola, so that the pixels with α ≥ 1/255 are
//! those within √((base − limit)/precision) of the middle. All rows of a tile are solved at once, as lanes.

use super::bin::{TILE_HEIGHT, TILE_WIDTH};
use super::project::Splat;
use crate::render::ALPHA_MIN_LOG2;

/// A splat seen from a tile's corner, with the span of every row.
pub(crate) struct Spans {
    /// First row that it may touch, and the one after the last, tile coordinates.
    pub rows: std::ops::Range<usize>,
    /// First column and the one after the last, by row; equal where nothing is covered.
    first: [u32; TILE_HEIGHT],
    end: [u32; TILE_HEIGHT],
    /// log₂ α at the middle of each row.
    base: [f32; TILE_HEIGHT],
    /// Column (tile coordinates) where α is largest, by row.
    middle: [f32; TILE_HEIGHT],
    /// Centre, tile coordinates.
    pub mean: [f32; 2],
}

/// One row of a splat inside a tile.
#[derive(Clone, Copy)]
pub(crate) struct Span {
    /// First column, and the one after the last.
    pub first: usize,
    pub end: usize,
    /// Column where α is largest.
    pub middle: f32,
    /// log₂ α there.
    pub base: f32,
    /// Row distance from the centre.
    pub dy: f32,
}

impl Spans {
    /// `rows`: the rows of the tile that are looked at; `columns`: how many columns the picture leaves it.
    #[inline(always)]
    pub fn new(splat: &Splat, left: usize, top: usize, rows: (usize, usize), columns: usize) -> Self {
        let mean = [splat.mean[0] - left as f32, splat.mean[1] - top as f32];
        let width = columns as f32;
        let mut spans = Self {
            rows: row_range(mean[1], splat.half[1], rows),
            first: [0; TILE_HEIGHT],
            end: [0; TILE_HEIGHT],
            base: [0.0; TILE_HEIGHT],
            middle: [0.0; TILE_HEIGHT],
            mean,
        };
        for y in 0..TILE_HEIGHT {
            let dy = y as f32 - mean[1];
            let base = splat.peak - splat.precision_y * (dy * dy);
            let rest = base - ALPHA_MIN_LOG2;
            let half = (if rest > 0.0 { rest } else { 0.0 }).sqrt() * splat.sigma_x;
            let middle = mean[0] + splat.shear * dy;
            let first = ceil_within(middle - half, width);
            let end = ceil_within(middle + half + END_SLACK, width);
            let end = if rest >= 0.0 { end } else { 0 };
            spans.first[y] = first;
            spans.end[y] = end;
            spans.base[y] = base;
            spans.middle[y] = middle;
        }
        spans
    }

    #[inline(always)]
    pub fn row(&self, y: usize) -> Span {
        Span {
            first: self.first[y] as usize,
            end: self.end[y] as usize,
            middle: self.middle[y],
            base: self.base[y],
            dy: y as f32 - self.mean[1],
        }
    }
}

/// The pixel at middle + half itself is inside: the end is the smallest integer above it.
const END_SLACK: f32 = 1e-5;

/// The smallest integer that is at least x, held to [0, width]. Rounding by a magic number is one addition at every
/// SIMD level; a ceiling instruction the baseline of x86 does not have.
#[inline(always)]
fn ceil_within(x: f32, width: f32) -> u32 {
    const ROUND: f32 = 8_388_608.0; // 2²³
    const _: () = assert!(TILE_WIDTH < 1 << 20);
    let x = if x > 0.0 { x } else { 0.0 };
    let x = if x < width { x } else { width };
    let nearest = x + ROUND;
    let up = u32::from(nearest - ROUND < x);
    (nearest.to_bits() & 0x7F_FFFF) + up
}

#[inline(always)]
fn row_range(mean: f32, half: f32, rows: (usize, usize)) -> std::ops::Range<usize> {
    // A little slack: the span of each row is exact.
    let first = ceil_within(mean - half - 1e-3, rows.1 as f32) as usize;
    let end = ceil_within(mean + half + 1e-3, rows.1 as f32) as usize;
    first.max(rows.0)..end
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ceilings_are_held_to_the_tile() {
        for (x, expected) in [
            (-3.0, 0),
            (0.0, 0),
            (1e-4, 1),
            (1.0, 1),
            (1.5, 2),
            (30.999, 31),
            (1e9, 32),
        ] {
            assert_eq!(ceil_within(x, 32.0), expected, "{x}");
        }
        assert_eq!(ceil_within(f32::NAN, 32.0), 0);
    }

    proptest! {
        /// Every pixel outside the span has α < 1/255 and every pixel inside has more, but for rounding at the rim.
        #[test]
        fn spans_hold_exactly_what_counts(
            mean in prop::array::uniform2(-20f32..52.0), shear in -2f32..2.0, px in 1e-4f32..2.0, py in 1e-4f32..2.0,
            opacity in 0.005f32..1.0,
        ) {
            let splat = Splat::of(mean, shear, px, py, opacity);
            let spans = Spans::new(&splat, 0, 0, (0, TILE_HEIGHT), TILE_WIDTH);
            for y in 0..TILE_HEIGHT {
                let span = spans.row(y);
                for x in 0..TILE_WIDTH {
                    let (dx, dy) = (f64::from(x as f32 - mean[0]), f64::from(y as f32 - mean[1]));
                    let e = dx - f64::from(shear) * dy;
                    let q = f64::from(px) * e * e + f64::from(py) * dy * dy;
                    let alpha = f64::from(opacity) * libm::exp(-0.5 * q);
                    let inside = spans.rows.contains(&y) && (span.first..span.end).contains(&x);
                    if alpha > 1.001 / 255.0 {
                        prop_assert!(inside, "({x}, {y}) with α = {alpha}");
                    }
                    if alpha < 0.98 / 255.0 {
                        prop_assert!(!inside, "({x}, {y}) with α = {alpha}");
                    }
                }
            }
        }
    }
}
