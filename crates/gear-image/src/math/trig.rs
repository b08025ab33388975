//! Sine, cosine and their inverses.

/// (sin x, cos x), x in radians. Full accuracy for |x| < 10⁶; NaN for infinities.
#[inline(always)]
pub fn sin_cos(x: f32) -> (f32, f32) {
    const ROUND64: f64 = 6_755_399_441_055_744.0; // 1.5·2⁵²
    let t = f64::from(x) * std::f64::consts::FRAC_2_PI + ROUND64;
    let n = t - ROUND64;
    let quadrant = t.to_bits() as u32 & 3;
    let r = f64::from(x) - n * std::f64::consts::FRAC_PI_2 - n * 6.123_233_995_736_766e-17;
    // Arguments too large for f64 to reduce leave a remainder that is meaningless but must stay in range.
    let r = if r > 1.0 { 1.0 } else { r };
    let r = (if r < -1.0 { -1.0 } else { r }) as f32;
    let z = r * r;
    let s = ((-1.951_529_6e-4f32 * z + 8.332_161e-3) * z - 0.166_666_55) * z * r + r;
    let c = ((2.443_315_7e-5f32 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    let (a, b) = if quadrant & 1 == 1 { (c, s) } else { (s, c) };
    let sin = if quadrant & 2 == 2 { -a } else { a };
    let cos = if (quadrant + 1) & 2 == 2 { -b } else { b };
    (sin, cos)
}

/// Sine of x radians.
#[inline(always)]
pub fn sin(x: f32) -> f32 {
    sin_cos(x).0
}

/// Cosine of x radians.
#[inline(always)]
pub fn cos(x: f32) -> f32 {
    sin_cos(x).1
}

/// Arctangent, in [−π/2, π/2].
#[inline(always)]
pub fn atan(x: f32) -> f32 {
    atan2(x, 1.0)
}

/// Angle of the point (x, y), in [−π, π]. `atan2(±0, +0)` is ±0, `atan2(±0, −0)` is ±π.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let (ax, ay) = (x.abs(), y.abs());
    let swap = ay > ax;
    let (big, small) = if swap { (ay, ax) } else { (ax, ay) };
    let both_infinite = small == f32::INFINITY;
    let q = if big == 0.0 { 0.0 } else { small / big };
    let q = if both_infinite { 1.0 } else { q };
    // q in [0, 1]; above tan(π/8) use atan q = π/4 + atan((q−1)/(q+1)).
    let upper = q > 0.414_213_57;
    let t = if upper { (q - 1.0) / (q + 1.0) } else { q };
    let z = t * t;
    let p = ((8.053_744_5e-2f32 * z - 1.387_768_6e-1) * z + 1.997_771_1e-1) * z - 3.333_295e-1;
    let a = p * z * t + t;
    let a = if upper { a + FRAC_PI_4 } else { a };
    let a = if swap { FRAC_PI_2 - a } else { a };
    let a = if x.is_sign_negative() { PI - a } else { a };
    let a = if x.is_nan() || y.is_nan() { f32::NAN } else { a };
    a.copysign(y)
}

/// Arc cosine, in [0, π]; NaN outside [−1, 1].
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    atan2(((1.0 - x) * (1.0 + x)).sqrt(), x)
}

/// Arc sine, in [−π/2, π/2]; NaN outside [−1, 1].
#[inline(always)]
pub fn asin(x: f32) -> f32 {
    atan2(x, ((1.0 - x) * (1.0 + x)).sqrt())
}
