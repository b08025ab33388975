//! Bilinear sampling at continuous positions; pixel centres are at integers, the rim is continued.

use crate::{Field, Rgb, Space};

/// The four pixels around a position and their weights; the position is clamped into the raster.
#[inline]
fn corners(x: f32, y: f32, width: usize, height: usize) -> ([usize; 4], [f32; 4]) {
    // `max` first: NaN becomes 0.
    let x = x.max(0.0).min((width - 1) as f32);
    let y = y.max(0.0).min((height - 1) as f32);
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
    let (u, v) = (x - x0 as f32, y - y0 as f32);
    (
        [y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1],
        [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v],
    )
}

/// The field at (x, y) in pixels. Panics on an empty raster.
#[inline]
pub fn bilinear(field: &Field, x: f32, y: f32) -> f32 {
    let (index, weight) = corners(x, y, field.width(), field.height());
    let data = field.data();
    (0..4).map(|i| weight[i] * data[index[i]]).fold(0.0, |a, b| a + b)
}

/// The colour at (x, y) in pixels. Panics on an empty raster.
#[inline]
pub fn bilinear_rgb<S: Space>(image: &Rgb<S>, x: f32, y: f32) -> [f32; 3] {
    let (index, weight) = corners(x, y, image.width(), image.height());
    let data = image.data();
    let mut out = [0.0; 3];
    for i in 0..4 {
        for c in 0..3 {
            out[c] += weight[i] * data[index[i]][c];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_sampled_exactly_and_continued_beyond_the_rim() {
        let plane = Field::from_fn(8, 6, |x, y| x as f32 + 10.0 * y as f32);
        assert_eq!(bilinear(&plane, 2.5, 3.25), 35.0);
        assert_eq!(bilinear(&plane, -4.0, 99.0), 50.0);
        assert_eq!(bilinear(&plane, f32::NAN, f32::INFINITY), 50.0);
        let rgb = Rgb::<crate::Srgb>::from_fn(8, 6, |x, y| [x as f32, y as f32, 1.0]);
        assert_eq!(bilinear_rgb(&rgb, 1.5, 2.5), [1.5, 2.5, 1.0]);
    }
}
