//! e^x and ln x in f64 without branches or tables, so that loops over Gaussians become vectors.

/// e^x for |x| ≤ 700, within 1e-15 of it.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5·2⁵²
    const LN2_HI: f64 = 6.931_471_803_691_238e-1;
    const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;
    let t = x * std::f64::consts::LOG2_E + ROUND;
    let n = t - ROUND;
    let r = x - n * LN2_HI - n * LN2_LO;
    // Taylor up to r¹²/12!; |r| ≤ 0.347, so that the rest is below 2e-16.
    let mut p = 2.087_675_698_786_81e-9;
    for c in [
        2.505_210_838_544_172e-8,
        2.755_731_922_398_589e-7,
        2.755_731_922_398_589e-6,
        2.480_158_730_158_73e-5,
        1.984_126_984_126_984e-4,
        1.388_888_888_888_889e-3,
        8.333_333_333_333_333e-3,
        4.166_666_666_666_666_4e-2,
        1.666_666_666_666_666_6e-1,
        0.5,
        1.0,
        1.0,
    ] {
        p = p * r + c;
    }
    // t's low bits hold n.
    f64::from_bits((t.to_bits() << 52).wrapping_add(p.to_bits()))
}

/// ln x for positive normal x, within 1e-13 of the larger of it and 1.
#[inline(always)]
pub(crate) fn ln(x: f64) -> f64 {
    const MAGIC: u64 = 0x4338_0000_0000_0000; // 1.5·2⁵², whose low bits take an integer
    const SQRT_HALF: u64 = 0x3FE6_A09E_667F_3BCD;
    // x = m·2^e with √½ ≤ m < √2. The exponent is taken with the bias of MAGIC, so that no integer is converted.
    let shifted = x.to_bits().wrapping_sub(SQRT_HALF).wrapping_add(1024 << 52);
    let e = f64::from_bits((shifted >> 52).wrapping_add(MAGIC)) - f64::from_bits(MAGIC) - 1024.0;
    let m = f64::from_bits(x.to_bits().wrapping_sub((shifted >> 52).wrapping_sub(1024) << 52));
    // ln m = 2 artanh z, |z| ≤ 0.172.
    let z = (m - 1.0) / (m + 1.0);
    let zz = z * z;
    let mut p = 1.0 / 17.0;
    for c in [
        1.0 / 15.0,
        1.0 / 13.0,
        1.0 / 11.0,
        1.0 / 9.0,
        1.0 / 7.0,
        0.2,
        1.0 / 3.0,
        1.0,
    ] {
        p = p * zz + c;
    }
    e * std::f64::consts::LN_2 + 2.0 * z * p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_agree_with_libm() {
        for i in -7000..=7000 {
            let x = f64::from(i) * 0.1;
            let exact = libm::exp(x);
            assert!(
                (exp(x) - exact).abs() <= 1e-15 * exact,
                "{x}: {:e}",
                (exp(x) - exact) / exact
            );
            let y = libm::exp(0.05 * f64::from(i) + 1e-3);
            let exact = libm::log(y);
            assert!((ln(y) - exact).abs() <= 1e-13 * exact.abs().max(1.0), "{y}");
        }
        assert_eq!((exp(0.0), ln(1.0)), (1.0, 0.0));
    }
}
