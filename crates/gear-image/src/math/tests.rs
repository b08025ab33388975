use super::*;

fn check(name: &str, ulps: f64, range: impl Iterator<Item = f32>, fast: fn(f32) -> f32, slow: fn(f64) -> f64) {
    let mut worst = (0.0, 0.0);
    for x in range {
        let exact = slow(f64::from(x));
        let got = f64::from(fast(x));
        let ulp = f64::from((exact as f32).abs().max(f32::MIN_POSITIVE)) * f64::from(f32::EPSILON);
        let error = (got - exact).abs() / ulp;
        if error > worst.0 {
            worst = (error, x);
        }
    }
    assert!(worst.0 <= ulps, "{name}({}) is off by {} ulp", worst.1, worst.0);
}

fn linear(a: f32, b: f32) -> impl Iterator<Item = f32> {
    (0..200_001).map(move |i| a + (b - a) * (i as f32 / 200_000.0))
}

/// Positive floats, evenly over their bit patterns.
fn logarithmic() -> impl Iterator<Item = f32> {
    (1..0x7f80_0000u32).step_by(9_973).map(f32::from_bits)
}

#[test]
fn errors_stay_within_the_documented_ulps() {
    check("exp", 1.5, linear(-87.0, 88.7), exp, libm::exp);
    check("ln", 1.5, logarithmic(), ln, libm::log);
    check("ln", 1.5, linear(0.5, 2.0), ln, libm::log);
    check("cbrt", 1.0, logarithmic(), cbrt, libm::cbrt);
    check("tanh", 3.0, linear(-12.0, 12.0), tanh, libm::tanh);
    check("logistic", 3.0, linear(-80.0, 80.0), logistic, |x| {
        1.0 / (1.0 + libm::exp(-x))
    });
    check("atan", 3.0, linear(-30.0, 30.0), atan, libm::atan);
    check("acos", 3.0, linear(-1.0, 0.999), acos, libm::acos);
    check("asin", 3.0, linear(-1.0, 1.0), asin, libm::asin);
    for y in [0.4f32, 1.0 / 2.4, 2.4, -1.5, 10.0] {
        for x in logarithmic() {
            let exact = libm::pow(f64::from(x), f64::from(y));
            if !(1e-36..3e38).contains(&exact) {
                continue;
            }
            let error = (f64::from(pow(x, y)) - exact).abs() / (exact * f64::from(f32::EPSILON));
            assert!(
                error <= 1.0 + f64::from(y.abs()) / 2.0,
                "pow({x}, {y}) is off by {error} ulp"
            );
        }
    }
}

#[test]
fn sine_and_cosine_are_right_to_an_absolute_ulp_of_one() {
    for x in linear(-1000.0, 1000.0) {
        let (s, c) = sin_cos(x);
        assert!((f64::from(s) - libm::sin(f64::from(x))).abs() < 1.2e-7, "sin({x})");
        assert!((f64::from(c) - libm::cos(f64::from(x))).abs() < 1.2e-7, "cos({x})");
    }
}

#[test]
fn special_values_come_out_as_ieee_has_them() {
    assert_eq!(exp(0.0), 1.0);
    assert_eq!(exp(-0.0), 1.0);
    assert_eq!(exp(f32::NEG_INFINITY), 0.0);
    assert_eq!(exp(f32::INFINITY), f32::INFINITY);
    assert_eq!(exp(1e30), f32::INFINITY);
    assert_eq!(exp(-1e30), 0.0);
    assert!(exp(-100.0) > 0.0, "subnormal results are kept");
    assert_eq!(ln(1.0), 0.0);
    assert_eq!(ln(0.0), f32::NEG_INFINITY);
    assert_eq!(ln(f32::INFINITY), f32::INFINITY);
    assert!(ln(-1.0).is_nan());
    assert_eq!(pow(0.0, 2.0), 0.0);
    assert_eq!(pow(0.0, 0.0), 1.0);
    assert_eq!(pow(0.0, -1.0), f32::INFINITY);
    assert_eq!(pow(5.0, 0.0), 1.0);
    assert_eq!(pow(1.0, 1e6), 1.0);
    assert_eq!(cbrt(27.0), 3.0);
    assert_eq!(cbrt(-8.0), -2.0);
    assert_eq!(cbrt(0.0), 0.0);
    assert_eq!(tanh(1e9), 1.0);
    assert_eq!(logistic(0.0), 0.5);
    assert_eq!(atan2(0.0, 1.0), 0.0);
    assert_eq!(atan2(0.0, -1.0), std::f32::consts::PI);
    assert_eq!(atan2(1.0, 0.0), std::f32::consts::FRAC_PI_2);
    assert_eq!(sin(0.0), 0.0);
    assert_eq!(cos(0.0), 1.0);
    let unary: [fn(f32) -> f32; 9] = [exp, ln, cbrt, tanh, logistic, sin, cos, atan, acos];
    for f in unary {
        assert!(f(f32::NAN).is_nan());
    }
    assert!(pow(f32::NAN, 2.0).is_nan() && pow(2.0, f32::NAN).is_nan() && pow(-1.0, 2.0).is_nan());
    assert!(sin(f32::INFINITY).is_nan());
}

#[test]
fn slices_and_scalars_have_the_same_bits() {
    let xs: Vec<f32> = linear(-90.0, 90.0).step_by(37).collect();
    let mut sliced = xs.clone();
    exp_slice(&mut sliced);
    assert!(xs.iter().zip(&sliced).all(|(&x, y)| exp(x).to_bits() == y.to_bits()));
    let mut sliced: Vec<f32> = xs.iter().map(|x| x.abs()).collect();
    ln_slice(&mut sliced);
    assert!(
        xs.iter()
            .zip(&sliced)
            .all(|(&x, y)| ln(x.abs()).to_bits() == y.to_bits())
    );
    let mut sliced = xs.clone();
    cbrt_slice(&mut sliced);
    assert!(xs.iter().zip(&sliced).all(|(&x, y)| cbrt(x).to_bits() == y.to_bits()));
    let mut sliced: Vec<f32> = xs.iter().map(|x| x.abs()).collect();
    pow_slice(&mut sliced, 1.3);
    assert!(
        xs.iter()
            .zip(&sliced)
            .all(|(&x, y)| pow(x.abs(), 1.3).to_bits() == y.to_bits())
    );
}
