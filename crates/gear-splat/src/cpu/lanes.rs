//! Neighbouring pixels of a row, as arrays that the compiler turns into vector registers.

use super::bin::{TILE_HEIGHT, TILE_WIDTH};
use super::project::Splat;
use super::spans::Span;
use crate::render::{ALPHA_MAX, ALPHA_MIN_LOG2, TRANSMITTANCE_MIN};

/// Pixels handled together: one AVX-512 register, two of AVX2, four of the baseline.
pub(crate) const LANES: usize = 16;
/// Pixels handled together where a span, or what is left of it, is no longer than that: many surfels are small.
pub(crate) const HALF: usize = LANES / 2;
/// A value for each of the pixels.
pub(crate) type Lanes = [f32; LANES];

/// Row length of a tile's buffers: a group of lanes that starts in the last column still fits.
pub(crate) const STRIDE: usize = TILE_WIDTH + LANES;
/// Length of a tile's buffer.
pub(crate) const PLANE_LEN: usize = STRIDE * TILE_HEIGHT;
/// One value for each pixel of a tile, and for the padding at the right of every row.
pub(crate) type Plane = [f32; PLANE_LEN];

/// Numbers of the lanes.
pub(crate) const LANE: Lanes = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];

/// `N` lanes of a plane from `at` on.
#[inline(always)]
pub(crate) fn load<const N: usize>(plane: &Plane, at: usize) -> [f32; N] {
    plane[at..at + N].try_into().expect("the slice has N entries")
}

/// Writes what [`load`] reads.
#[inline(always)]
pub(crate) fn store<const N: usize>(plane: &mut Plane, at: usize, lanes: &[f32; N]) {
    plane[at..at + N].copy_from_slice(lanes);
}

/// Sum of the lanes, as a tree of fixed shape.
#[inline(always)]
pub(crate) fn sum(x: Lanes) -> f32 {
    let mut eight = [0.0; 8];
    for l in 0..8 {
        eight[l] = x[l] + x[l + 8];
    }
    let mut four = [0.0; 4];
    for l in 0..4 {
        four[l] = eight[l] + eight[l + 4];
    }
    (four[0] + four[2]) + (four[1] + four[3])
}

/// True when no lane is at least `least`.
#[inline(always)]
pub(crate) fn all_below<const N: usize>(x: &[f32; N], least: f32) -> bool {
    let mut any = 0;
    for lane in x {
        any |= u32::from(*lane >= least);
    }
    any == 0
}

/// 2^x for −120 ≤ x ≤ 0, within 2 ulp; 2⁰ = 1 exactly. Elsewhere the answer is some number.
///
/// Cephes' polynomial for 2^r, |r| ≤ ½. The integer part goes into the exponent: adding 1.5·2²³ leaves it in the low
/// bits of the sum.
#[inline(always)]
pub(crate) fn exp2_nonpositive(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0;
    let t = x + ROUND;
    let r = x - (t - ROUND);
    let p = 1.535_336_2e-4f32;
    let p = p * r + 1.339_887_4e-3;
    let p = p * r + 9.618_437e-3;
    let p = p * r + 5.550_332_6e-2;
    let p = p * r + 0.240_226_48;
    let p = p * r + std::f32::consts::LN_2;
    let p = p * r + 1.0;
    f32::from_bits((t.to_bits() << 23).wrapping_add(p.to_bits()))
}

/// α of a pixel that lies `along` the row from its middle: zero where it is below 1/255, and where the transmittance
/// `before` says that the pixel is finished.
#[inline(always)]
pub(crate) fn alpha(splat: &Splat, span: &Span, along: f32, before: f32) -> f32 {
    let y = span.base - splat.precision_x * (along * along);
    let a = exp2_nonpositive(y);
    let a = if a < ALPHA_MAX { a } else { ALPHA_MAX };
    // Bit patterns instead of a choice between numbers: what 2^y gives for far pixels is never looked at.
    let counts = (y >= ALPHA_MIN_LOG2) & (before >= TRANSMITTANCE_MIN);
    if counts { a } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_within_two_ulp() {
        for i in 0..200_000 {
            let x = -120.0 * (i as f32) / 200_000.0;
            let exact = libm::exp2(f64::from(x));
            let error = (f64::from(exp2_nonpositive(x)) - exact).abs() / exact;
            assert!(error < 2.0 * f64::from(f32::EPSILON), "{x}: {error:e}");
        }
        assert_eq!(exp2_nonpositive(0.0), 1.0);
    }
}
