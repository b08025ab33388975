//! Eight neighbouring pixels of a row at a time, as arrays that the compiler turns into vector registers.

use super::bin::{TILE_HEIGHT, TILE_WIDTH};
use super::project::Splat;
use crate::render::{ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN};

/// Pixels handled together.
pub(crate) const LANES: usize = 8;
/// A value for each of the pixels.
pub(crate) type Lanes = [f32; LANES];

/// Row length of a tile's buffers: a group of lanes that starts in the last column still fits.
pub(crate) const STRIDE: usize = TILE_WIDTH + LANES;
/// Length of a tile's buffer.
pub(crate) const PLANE_LEN: usize = STRIDE * TILE_HEIGHT;
/// One value for each pixel of a tile, and for the padding at the right of every row.
pub(crate) type Plane = [f32; PLANE_LEN];

/// Numbers of the lanes.
pub(crate) const LANE: Lanes = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// The lanes of a plane from `at` on.
#[inline(always)]
pub(crate) fn at(plane: &mut Plane, at: usize) -> &mut Lanes {
    (&mut plane[at..at + LANES])
        .try_into()
        .expect("the slice has LANES entries")
}

/// Sum of the lanes, as a tree of fixed shape.
#[inline(always)]
pub(crate) fn sum(x: Lanes) -> f32 {
    ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]))
}

/// True when no lane is at least `least`.
#[inline(always)]
pub(crate) fn all_below(x: &Lanes, least: f32) -> bool {
    let mut any = 0;
    for lane in x {
        any |= u32::from(*lane >= least);
    }
    any == 0
}

/// e^x for −80 ≤ x ≤ 0 (smaller x are taken as −80), within 2 ulp; e⁰ = 1 exactly.
///
/// The polynomial and the reduction of `gear_image::math::exp` without the cases that α never meets.
#[inline(always)]
pub(crate) fn exp_nonpositive(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0; // 1.5·2²³
    const LN2_HI: f32 = 355.0 / 512.0;
    const LN2_LO: f32 = -2.121_944_4e-4;
    let x = if x > -80.0 { x } else { -80.0 };
    let t = x * std::f32::consts::LOG2_E + ROUND;
    let n = t - ROUND;
    let r = x - n * LN2_HI - n * LN2_LO;
    let p = 1.987_569_1e-4f32;
    let p = p * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 0.166_666_66;
    let p = p * r + 0.5;
    let p = p * (r * r) + r + 1.0;
    // t's low bits hold n; n ≥ −116, so the exponent stays normal.
    f32::from_bits((t.to_bits() << 23).wrapping_add(p.to_bits()))
}

/// One row of a splat inside a tile.
#[derive(Clone, Copy)]
pub(crate) struct RowSpan {
    /// First and last column, tile coordinates.
    pub first: usize,
    pub last: usize,
    /// Column (tile coordinates) where q is smallest in this row.
    pub middle: f32,
    /// Row distance from the centre.
    pub dy: f32,
    /// The row's share of q.
    pub base: f32,
}

/// A splat seen from a tile's corner.
#[derive(Clone, Copy)]
pub(crate) struct TileSplat<'a> {
    pub splat: &'a Splat,
    /// Centre, tile coordinates.
    pub mean: [f32; 2],
    /// First row that the splat may touch, and the one after the last, tile coordinates.
    first_row: usize,
    end_row: usize,
}

impl<'a> TileSplat<'a> {
    #[inline(always)]
    pub fn new(splat: &'a Splat, left: usize, top: usize, rows: usize) -> Self {
        let mean = [splat.mean[0] - left as f32, splat.mean[1] - top as f32];
        let half = (splat.cutoff / splat.precision_y).sqrt() + 1e-3;
        let first = (mean[1] - half).ceil().max(0.0);
        let last = (mean[1] + half).floor().min(rows as f32 - 1.0);
        Self {
            splat,
            mean,
            first_row: first as usize,
            end_row: (last + 1.0).max(0.0) as usize,
        }
    }

    /// The rows that it may touch.
    #[inline(always)]
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.first_row..self.end_row
    }

    /// The pixels of row `y` within the cutoff, among `columns`.
    #[inline(always)]
    pub fn row(&self, y: usize, columns: usize) -> Option<RowSpan> {
        let dy = y as f32 - self.mean[1];
        let base = self.splat.precision_y * dy * dy;
        let rest = self.splat.cutoff - base;
        if rest < 0.0 {
            return None;
        }
        let half = rest.sqrt() * self.splat.sigma_x;
        let middle = self.mean[0] + self.splat.shear * dy;
        let first = (middle - half).ceil().max(0.0);
        let last = (middle + half).floor().min(columns as f32 - 1.0);
        (first <= last).then_some(RowSpan {
            first: first as usize,
            last: last as usize,
            middle,
            dy,
            base,
        })
    }
}

/// α of a pixel that lies `along` the row from its middle: zero where it is not covered, and where the transmittance
/// `before` says that it is finished.
#[inline(always)]
pub(crate) fn alpha(splat: &Splat, span: &RowSpan, along: f32, before: f32) -> f32 {
    let q = splat.precision_x * (along * along) + span.base;
    let a = splat.opacity * exp_nonpositive(-0.5 * q);
    let a = if a < ALPHA_MAX { a } else { ALPHA_MAX };
    let counts = (a >= ALPHA_MIN) & (before >= TRANSMITTANCE_MIN);
    if counts { a } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_within_two_ulp() {
        for i in 0..200_000 {
            let x = -80.0 * (i as f32) / 200_000.0;
            let exact = libm::exp(f64::from(x));
            let error = (f64::from(exp_nonpositive(x)) - exact).abs() / exact;
            assert!(error < 2.0 * f64::from(f32::EPSILON), "{x}: {error:e}");
        }
        assert_eq!(exp_nonpositive(0.0), 1.0);
        assert!(exp_nonpositive(-1e30) < 1e-34 && exp_nonpositive(f32::NEG_INFINITY) < 1e-34);
    }
}
