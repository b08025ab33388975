//! Luma as the reference sees it.

use gear_image::SrgbImage;

/// A plane of f64 samples, row-major.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub data: Vec<f64>,
}

impl Plane {
    /// The top left `width` × `height` samples.
    pub fn cropped(&self, width: usize, height: usize) -> Self {
        let rows = self.data.chunks_exact(self.width.max(1)).take(height);
        Self {
            width,
            height,
            data: rows.flat_map(|row| &row[..width]).copied().collect(),
        }
    }
}

/// MATLAB's Y of YCbCr (ITU-R BT.601, 16..235) of the picture's 8-bit codes, rounded to integers.
///
/// The picture is brought to 8 bits first, so that the figure is the one that the reference gives for the PNG.
pub(super) fn luma(picture: &SrgbImage) -> Plane {
    let code = |v: f32| (f64::from(v).clamp(0.0, 1.0) * 255.0).round() / 255.0;
    let y = |&[r, g, b]: &[f32; 3]| {
        let y = 65.481 * code(r) + 128.553 * code(g) + 24.966 * code(b) + 16.0;
        // NaN in, black out: a picture never holds any, and `clamp` would keep it.
        if y.is_nan() { 16.0 } else { y.round_ties_even() }
    };
    Plane {
        width: picture.width(),
        height: picture.height(),
        data: picture.data().iter().map(y).collect(),
    }
}
