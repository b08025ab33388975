//! Filters on rasters: Gaussian, box mean, gradients, sampling, resizing, morphology, components, distance.
//!
//! Rows are shared out over threads; no result depends on how.

mod box_mean;
mod components;
mod distance;
mod gaussian;
mod gradient;
mod morphology;
mod resize;
mod sample;

pub use box_mean::box_mean;
pub use components::{Components, Connectivity, components};
pub use distance::{Nearest, distance_to, nearest};
pub use gaussian::{blurred_light_rows, gaussian, gaussian_rgb};
pub use gradient::{gradient, gradient_x, gradient_y};
pub use morphology::{Beyond, close, dilate, dilate_field, erode, open};
pub(crate) use resize::AreaRows;
pub use resize::{fit_longer_side, resize, resize_image, resize_mask, resize_rgb};
pub use sample::{bilinear, bilinear_rgb};

/// Index `i` of a row of `n` samples continued by mirror images: d c b a | a b c d | d c b a.
#[inline]
pub(crate) fn reflect(i: isize, n: usize) -> usize {
    let i = i.rem_euclid(2 * n as isize) as usize;
    if i < n { i } else { 2 * n - 1 - i }
}
