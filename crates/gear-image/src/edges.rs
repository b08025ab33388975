//! Soft contours of a colour picture.

use rayon::prelude::*;

use crate::filter::{gaussian_rgb, gradient};
use crate::{Field, LinearImage, Rgb, math, stats};

/// Contour strength in [0, 1]: the colour gradient of the cube-root image (lightness-like, as in CIE Lab), blurred
/// by `sigma` pixels, scaled so that its `quantile` is 1, and clamped. All 0 where nothing varies.
pub fn soft_edges(light: &LinearImage, sigma: f64, quantile: f64) -> Field {
    let (width, height) = light.size();
    let mut strength = cube_root_gradient(light, sigma);
    let scale = stats::quantile(strength.data(), quantile).unwrap_or(0.0);
    if scale.is_nan() || scale <= 1e-6 {
        return Field::filled(width, height, 0.0);
    }
    strength.data_mut().par_chunks_mut(1 << 14).for_each(|chunk| {
        for x in chunk {
            *x = (*x / scale).min(1.0);
        }
    });
    strength
}

/// Norm over channels and directions of the gradient of the blurred cube-root image, per pixel.
fn cube_root_gradient(light: &LinearImage, sigma: f64) -> Field {
    let (width, height) = light.size();
    let mut roots = light.clone();
    roots.data_mut().par_chunks_mut(1 << 12).for_each(|chunk| {
        let flat = chunk.as_flattened_mut();
        flat.iter_mut().for_each(|x| *x = x.max(0.0));
        math::cbrt_slice(flat);
    });
    let roots = gaussian_rgb(&roots, sigma);
    let mut squares = Field::filled(width, height, 0.0);
    for channel in 0..3 {
        let (gx, gy) = gradient(&plane(&roots, channel));
        for ((sum, x), y) in squares.data_mut().iter_mut().zip(gx.data()).zip(gy.data()) {
            *sum += x * x + y * y;
        }
    }
    squares.data_mut().iter_mut().for_each(|x| *x = x.sqrt());
    squares
}

fn plane<S: crate::Space>(image: &Rgb<S>, channel: usize) -> Field {
    Field::from_vec(
        image.width(),
        image.height(),
        image.data().iter().map(|p| p[channel]).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_picture_has_no_contour() {
        let edges = soft_edges(&Rgb::filled(20, 12, [0.3, 0.5, 0.1]), 1.0, 0.98);
        assert!(edges.data().iter().all(|&e| e == 0.0));
        assert_eq!(soft_edges(&Rgb::filled(1, 1, [0.3; 3]), 1.0, 0.98).data(), [0.0]);
    }

    #[test]
    fn a_step_of_hue_alone_is_a_contour() {
        let picture = Rgb::from_fn(60, 40, |x, _| if x < 30 { [0.5, 0.1, 0.1] } else { [0.1, 0.2188, 0.1] });
        let edges = soft_edges(&picture, 1.0, 0.98);
        assert!(edges.at(29, 20) > 0.9 && edges.at(5, 20) < 1e-3);
    }
}
