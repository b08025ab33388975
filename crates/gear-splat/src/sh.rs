//! Real spherical harmonics up to degree 3, in the signs and order of 3DGS.
//!
//! Colour of a Gaussian seen along the unit direction d (camera to Gaussian): `0.5 + Σ_k Y_k(d) · c_k`, where `c_0`
//! is `f_dc` and `c_1…` are `f_rest`, stored channel-major: all of red, then green, then blue.

use glam::{DVec3, Vec3};

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

/// What the basis functions above the constant one become when y and z change their signs.
pub const TURNED_OVER: [f32; 15] = [
    -1.0, -1.0, 1.0, // degree 1
    -1.0, 1.0, 1.0, -1.0, 1.0, // degree 2
    -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, // degree 3
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
    basis_at(degree, d.as_dvec3())
}

/// [`basis`] of an f64 direction.
pub(crate) fn basis_at(degree: u8, d: DVec3) -> [f64; 15] {
    let mut y = [0.0; 15];
    let (x1, y1, z1) = (d.x, d.y, d.z);
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

/// Derivatives of [`basis`] by the components of `d`, taken as free variables.
pub(crate) fn basis_gradient(degree: u8, d: Vec3) -> [DVec3; 15] {
    let mut g = [DVec3::ZERO; 15];
    let DVec3 { x, y, z } = d.as_dvec3();
    if degree >= 1 {
        g[0] = DVec3::NEG_Y * Y1;
        g[1] = DVec3::Z * Y1;
        g[2] = DVec3::NEG_X * Y1;
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    if degree >= 2 {
        g[3] = DVec3::new(y, x, 0.0) * Y2[0];
        g[4] = DVec3::new(0.0, z, y) * Y2[1];
        g[5] = DVec3::new(-2.0 * x, -2.0 * y, 4.0 * z) * Y2[2];
        g[6] = DVec3::new(z, 0.0, x) * Y2[3];
        g[7] = DVec3::new(2.0 * x, -2.0 * y, 0.0) * Y2[4];
    }
    if degree >= 3 {
        g[8] = DVec3::new(6.0 * x * y, 3.0 * (xx - yy), 0.0) * Y3[0];
        g[9] = DVec3::new(y * z, x * z, x * y) * Y3[1];
        g[10] = DVec3::new(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z) * Y3[2];
        g[11] = DVec3::new(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * (xx + yy)) * Y3[3];
        g[12] = DVec3::new(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z) * Y3[4];
        g[13] = DVec3::new(2.0 * x * z, -2.0 * y * z, xx - yy) * Y3[5];
        g[14] = DVec3::new(3.0 * (xx - yy), -6.0 * x * y, 0.0) * Y3[6];
    }
    g
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_of_the_basis_is_its_difference() {
        let d = Vec3::new(0.36, -0.48, 0.8);
        let gradient = basis_gradient(3, d);
        for (axis, unit) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            let h = 1.0 / 1024.0;
            let (a, b) = (basis(3, d + unit * h), basis(3, d - unit * h));
            for k in 0..15 {
                let slope = (a[k] - b[k]) / (2.0 * f64::from(h));
                assert!((slope - gradient[k][axis]).abs() < 1e-4, "{k} {axis}");
            }
        }
    }

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
