//! Small stencils on fields and masks that the chain shares.

use gear_image::filter::{gaussian, gradient};
use gear_image::{Field, Mask};

/// Forward map of two equal rasters.
pub(crate) fn zip(a: &Field, b: &Field, f: impl Fn(f32, f32) -> f32) -> Field {
    Field::from_vec(
        a.width(),
        a.height(),
        a.data().iter().zip(b.data()).map(|(&a, &b)| f(a, b)).collect(),
    )
}

/// Map of a raster.
pub(crate) fn map(a: &Field, f: impl Fn(f32) -> f32) -> Field {
    Field::from_vec(a.width(), a.height(), a.data().iter().map(|&a| f(a)).collect())
}

/// The field inside the mask, 0 outside.
pub fn masked(field: &Field, mask: &Mask) -> Field {
    Field::from_vec(
        field.width(),
        field.height(),
        field
            .data()
            .iter()
            .zip(mask.data())
            .map(|(&f, &m)| if m { f } else { 0.0 })
            .collect(),
    )
}

/// Normalised convolution `G∗(w f) / G∗w`: a Gaussian mean over the pixels of weight `w` only.
pub fn weighted_gaussian(field: &Field, weight: &Field, sigma: f64) -> Field {
    let sums = gaussian(&zip(field, weight, |f, w| f * w), sigma);
    let weights = gaussian(weight, sigma);
    zip(&sums, &weights, |s, w| s / w.max(1e-6))
}

/// Unit normals of a height field in image space (x right, y down, z towards the viewer).
pub fn normals(height: &Field) -> Vec<[f32; 3]> {
    let (gx, gy) = gradient(height);
    gx.data()
        .iter()
        .zip(gy.data())
        .map(|(&p, &q)| normal_of_slope(p, q))
        .collect()
}

/// The unit normal of the slopes `p = ∂h/∂x`, `q = ∂h/∂y`.
#[inline]
pub fn normal_of_slope(p: f32, q: f32) -> [f32; 3] {
    let inverse = 1.0 / (p * p + q * q + 1.0).sqrt();
    [-p * inverse, -q * inverse, inverse]
}

/// Dot product of two vectors.
#[inline]
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// City-block distance of every pixel to the nearest pixel outside the mask (0 outside). The picture's frame is
/// no outside: a cropped figure goes on beyond it. `u32::MAX / 2` where there is no outside at all.
pub fn depth_inside(mask: &Mask) -> Vec<u32> {
    let (w, h) = mask.size();
    let far = u32::MAX / 2;
    let mut d: Vec<u32> = mask.data().iter().map(|&m| if m { far } else { 0 }).collect();
    for y in 0..h {
        for x in 0..w {
            let p = y * w + x;
            let left = if x > 0 { d[p - 1] + 1 } else { far };
            let up = if y > 0 { d[p - w] + 1 } else { far };
            d[p] = d[p].min(left).min(up);
        }
    }
    for y in (0..h).rev() {
        for x in (0..w).rev() {
            let p = y * w + x;
            let right = if x + 1 < w { d[p + 1] + 1 } else { far };
            let down = if y + 1 < h { d[p + w] + 1 } else { far };
            d[p] = d[p].min(right).min(down);
        }
    }
    d
}

/// Pixels more than `rim` steps away from the outside of the mask.
pub fn eroded(mask: &Mask, rim: u32) -> Mask {
    let (w, h) = mask.size();
    Mask::from_vec(w, h, depth_inside(mask).into_iter().map(|d| d > rim).collect())
}

/// The values inside the mask.
pub(crate) fn inside(field: &Field, mask: &Mask) -> Vec<f32> {
    field
        .data()
        .iter()
        .zip(mask.data())
        .filter_map(|(&f, &m)| m.then_some(f))
        .collect()
}
