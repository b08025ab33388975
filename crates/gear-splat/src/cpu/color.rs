//! Colours as a camera sees them.

use rayon::prelude::*;

use crate::{Camera, Scene, sh};

/// Colours of the Gaussians `ids`, in their order, not below zero (3DGS).
pub(crate) fn colors(scene: &Scene, camera: &Camera, ids: &[u32]) -> Vec<[f32; 3]> {
    ids.par_iter()
        .with_min_len(4096)
        .map(|&id| raw_color(scene, camera, id as usize).map(|c| c.max(0.0)))
        .collect()
}

/// Colour of Gaussian `i` before it is held above zero. A Gaussian whose higher coefficients are all zero costs as
/// little as one that has none.
pub(crate) fn raw_color(scene: &Scene, camera: &Camera, i: usize) -> [f32; 3] {
    let mut color = scene.color(i);
    let rest = scene.sh_rest_of(i);
    if rest.iter().any(|&r| r != 0.0) {
        let basis = sh::basis(scene.sh_degree, camera.direction_to(scene.centers[i]));
        let bands = sh::bands(scene.sh_degree);
        for (c, rest) in color.iter_mut().zip(rest.chunks_exact(bands)) {
            let sum: f64 = rest.iter().zip(&basis).map(|(&r, y)| f64::from(r) * y).sum();
            *c += sum as f32;
        }
    }
    color
}
