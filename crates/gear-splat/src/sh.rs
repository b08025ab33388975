//! Real spherical harmonics up to degree 3, in the signs and order of 3DGS.
//!
//! Colour of a Gaussian seen along the unit direction d (camera to Gaussian): `0.5 + Σ_k Y_k(d) · c_k`, where `c_0`
//! is `f_dc` and `c_1…` are `f_rest`, stored channel-major: all of red, then green, then blue.

use glam::Vec3;

/// The largest SH degree that 3DGS files carry.
pub const MAX_DEGREE: u8 = 3;

/// The constant basis function, 1 / (2√π).
pub const Y0: f32 = 0.282_094_79;

const Y1: f64 = 0.488_602_511_902_919_9;
const Y2: [f64; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
const Y3: [f64; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// `f_dc` of an sRGB-encoded colour component.
pub fn dc_from_color(color: f32) -> f32 {
    (color - 0.5) / Y0
}

/// sRGB-encoded colour component of an `f_dc`.
pub fn color_from_dc(dc: f32) -> f32 {
    0.5 + Y0 * dc
}

/// Number of higher coefficients of one channel: `(degree + 1)² − 1`.
pub fn bands(degree: u8) -> usize {
    let n = usize::from(degree) + 1;
    n * n - 1
}

/// Number of `f_rest` entries of a Gaussian.
pub fn rest_count(degree: u8) -> usize {
    3 * bands(degree)
}

/// The basis functions above the constant one at unit direction `d`; entries past [`bands`] of `degree` are zero.
pub fn basis(degree: u8, d: Vec3) -> [f64; 15] {
    let mut y = [0.0; 15];
    let (x1, y1, z1) = (f64::from(d.x), f64::from(d.y), f64::from(d.z));
    if degree >= 1 {
        y[..3].copy_from_slice(&[-Y1 * y1, Y1 * z1, -Y1 * x1]);
    }
    let (xx, yy, zz) = (x1 * x1, y1 * y1, z1 * z1);
    if degree >= 2 {
        y[3] = Y2[0] * x1 * y1;
        y[4] = Y2[1] * y1 * z1;
        y[5] = Y2[2] * (2.0 * zz - xx - yy);
        y[6] = Y2[3] * x1 * z1;
        y[7] = Y2[4] * (xx - yy);
    }
    if degree >= 3 {
        y[8] = Y3[0] * y1 * (3.0 * xx - yy);
        y[9] = Y3[1] * x1 * y1 * z1;
        y[10] = Y3[2] * y1 * (4.0 * zz - xx - yy);
        y[11] = Y3[3] * z1 * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        y[12] = Y3[4] * x1 * (4.0 * zz - xx - yy);
        y[13] = Y3[5] * z1 * (xx - yy);
        y[14] = Y3[6] * x1 * (xx - 3.0 * yy);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_is_orthonormal_over_the_sphere() {
        // Fibonacci sphere: an equal-area rule, accurate to about 1/n for polynomials of degree 6.
        let n = 20_000;
        let mut gram = [[0.0f64; 16]; 16];
        for i in 0..n {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
            let (sin, cos) = libm::sincos(2.399_963_229_728_653 * f64::from(i));
            let r = (1.0 - z * z).sqrt();
            let d = Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32);
            let mut y = [f64::from(Y0); 16];
            y[1..].copy_from_slice(&basis(3, d));
            for a in 0..16 {
                for b in 0..16 {
                    gram[a][b] += y[a] * y[b] * 4.0 * std::f64::consts::PI / f64::from(n);
                }
            }
        }
        for (a, row) in gram.iter().enumerate() {
            for (b, &g) in row.iter().enumerate() {
                assert!((g - f64::from(u8::from(a == b))).abs() < 1e-3, "{a} {b} {g}");
            }
        }
    }

    #[test]
    fn colour_and_coefficient_convert_both_ways() {
        for color in [0.0, 0.25, 0.5, 1.0, 1.7] {
            assert!((color_from_dc(dc_from_color(color)) - color).abs() < 1e-6);
        }
        assert_eq!([0, 1, 2, 3].map(rest_count), [0, 9, 24, 45]);
    }
}
