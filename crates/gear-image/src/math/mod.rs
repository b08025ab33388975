//! Elementary functions whose bits are the same on every CPU, thread count and SIMD level.
//!
//! The platform's `exp`, `ln` and friends change their last bits with the C library and with the CPU it runs
//! on, so results that are hashed may not use them. These are made only of additions, multiplications,
//! divisions, square roots, selects and integer operations on the bits, each of which IEEE 754 fixes; nothing
//! is fused (`mul_add` would be, on some CPUs). They have no branches, so that a plain loop over them
//! vectorises: the slice versions below are such loops, compiled once per SIMD level by `multiversion`.
//!
//! Range reduction rounds by adding and subtracting 1.5·2²³ (2⁵² in f64), which leaves the nearest integer in
//! the low bits of the mantissa. The polynomials are Cephes' (S. Moshier). Errors are relative, against
//! correctly rounded f64: [`exp`], [`ln`] 1.5 ulp, [`cbrt`] 1 ulp, [`pow`] (1 + |y|/2) ulp, the others 3 ulp;
//! the tests check a dense sample of the range. NaN in gives NaN out.

mod slices;
mod trig;

pub use slices::{cbrt_slice, exp_slice, ln_slice, logistic_slice, map_slice, pow_slice};
pub use trig::{acos, asin, atan, atan2, cos, sin, sin_cos};

const ROUND: f32 = 12_582_912.0; // 1.5·2²³
const LOG2_E: f32 = std::f32::consts::LOG2_E;
const LN2_HI: f32 = 355.0 / 512.0; // 9 bits, so n·LN2_HI is exact
const LN2_LO: f32 = -2.121_944_4e-4;

/// e^r for |r| ≤ ln2/2; exactly 1 at 0.
#[inline(always)]
fn exp_reduced(r: f32) -> f32 {
    let p = 1.987_569_1e-4f32;
    let p = p * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 0.166_666_66;
    let p = p * r + 0.5;
    p * (r * r) + r + 1.0
}

/// y·2ⁿ for |n| ≤ 250, in two factors so that overflow and gradual underflow come out right.
#[inline(always)]
fn scale2(y: f32, n: i32) -> f32 {
    let half = n >> 1;
    let rest = n - half;
    let a = f32::from_bits(((half + 127) as u32) << 23);
    let b = f32::from_bits(((rest + 127) as u32) << 23);
    y * a * b
}

/// eˣ. `exp(0) == 1` exactly; overflows to infinity above 88.72, underflows gradually to 0 below −103.98.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let low = if x < -105.0 { -105.0 } else { x };
    let x = if low > 89.0 { 89.0 } else { low };
    let t = x * LOG2_E + ROUND;
    let n = t - ROUND;
    let r = x - n * LN2_HI - n * LN2_LO;
    let n = (t.to_bits() as i32)
        .wrapping_sub(ROUND.to_bits() as i32)
        .clamp(-160, 160);
    scale2(exp_reduced(r), n)
}

/// 2ᵏ·m = x with m in [√½, √2): (k as a float, m − 1). For positive finite x, subnormals included.
#[inline(always)]
fn split(x: f32) -> (f32, f32) {
    let tiny = x < f32::MIN_POSITIVE;
    let scaled = if tiny { x * 33_554_432.0 } else { x };
    let shift = if tiny { -25 } else { 0 };
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let bits = scaled.to_bits().wrapping_sub(SQRT_HALF);
    let k = (bits as i32) >> 23;
    let m = f32::from_bits((bits & 0x007f_ffff) + SQRT_HALF);
    ((k + shift) as f32, m - 1.0)
}

/// ln(1 + f) − f for 1 + f in [√½, √2).
#[inline(always)]
fn ln_1p_tail(f: f32) -> f32 {
    let p = 7.037_683_6e-2f32;
    let p = p * f - 1.151_461e-1;
    let p = p * f + 1.167_699_9e-1;
    let p = p * f - 1.242_014_1e-1;
    let p = p * f + 1.424_932_3e-1;
    let p = p * f - 1.666_805_8e-1;
    let p = p * f + 2.000_071_5e-1;
    let p = p * f - 2.499_999_4e-1;
    let p = p * f + 3.333_333e-1;
    let z = f * f;
    p * f * z - 0.5 * z
}

/// Natural logarithm. `ln(1) == 0` exactly; −∞ at 0, NaN below.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    let (k, f) = split(x);
    let y = f + (ln_1p_tail(f) + k * LN2_LO) + k * LN2_HI;
    let y = if x == f32::INFINITY { x } else { y };
    let y = if x == 0.0 { f32::NEG_INFINITY } else { y };
    if x >= 0.0 { y } else { f32::NAN }
}

/// x^y for x ≥ 0 (NaN below). x⁰ = 1; 0^y is 0 for y > 0 and ∞ for y < 0.
///
/// The logarithm's integer part and the product with y are kept in f64, so that the error does not grow with
/// the size of y·ln x.
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    let (k, f) = split(x);
    let log = f64::from(k) * std::f64::consts::LN_2 + (f64::from(f) + f64::from(ln_1p_tail(f)));
    let e = log * f64::from(y);
    let e = if e < -105.0 { -105.0 } else { e };
    let e = if e > 89.0 { 89.0 } else { e };
    const ROUND64: f64 = 6_755_399_441_055_744.0; // 1.5·2⁵²
    let t = e * std::f64::consts::LOG2_E + ROUND64;
    let n = t - ROUND64;
    let r = (e - n * std::f64::consts::LN_2) as f32;
    let n = (t.to_bits() as i64)
        .wrapping_sub(ROUND64.to_bits() as i64)
        .clamp(-160, 160) as i32;
    let p = scale2(exp_reduced(r), n);
    let p = if x == f32::INFINITY {
        if y > 0.0 { x } else { 0.0 }
    } else {
        p
    };
    let p = if x == 0.0 {
        if y > 0.0 { 0.0 } else { f32::INFINITY }
    } else {
        p
    };
    let p = if y.is_nan() { f32::NAN } else { p };
    let p = if y == 0.0 { 1.0 } else { p };
    if x >= 0.0 { p } else { f32::NAN }
}

/// Cube root, odd.
#[inline(always)]
pub fn cbrt(x: f32) -> f32 {
    let a = x.abs();
    let tiny = a < f32::MIN_POSITIVE;
    let scaled = if tiny { a * 16_777_216.0 } else { a }; // 2²⁴
    let guess = f32::from_bits(scaled.to_bits() / 3 + 709_958_130);
    // Halley's iteration, cubic: 5 bits, 16, 48.
    let b = f64::from(scaled);
    let mut t = f64::from(guess);
    let mut cube = t * t * t;
    t = t * (b + b + cube) / (b + cube + cube);
    cube = t * t * t;
    t = t * (b + b + cube) / (b + cube + cube);
    let root = if tiny { t * 0.003_906_25 } else { t }; // 2⁻⁸
    let root = root as f32;
    let special = a == 0.0 || a == f32::INFINITY || x.is_nan();
    if special { x } else { root.copysign(x) }
}

/// Hyperbolic tangent.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    let a = x.abs();
    let z = a * a;
    let p = -5.704_988e-3f32;
    let p = p * z + 2.063_908_8e-2;
    let p = p * z - 5.373_971_5e-2;
    let p = p * z + 1.333_144_2e-1;
    let p = p * z - 3.333_328e-1;
    let small = p * z * a + a;
    let large = 1.0 - 2.0 / (exp(2.0 * a) + 1.0);
    let t = if a < 0.625 { small } else { large };
    t.copysign(x)
}

/// 1/(1 + e⁻ˣ).
#[inline(always)]
pub fn logistic(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

#[cfg(test)]
mod tests;
