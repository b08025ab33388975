//! What goes to the GPU: the camera, and the scene as the camera stands to it.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::TILE;
use crate::render::ScreenFilter;
use crate::{Camera, Projection, RenderOptions, Scene, sh};

/// Words of `struct View` in common.wgsl.
pub(super) const VIEW_WORDS: usize = 32;
/// Where the number of pairs stands in it.
const PAIRS: usize = 26;
/// Words of `struct Gaussian` in footprint.wgsl.
const GAUSSIAN_WORDS: usize = 12;

/// Columns and rows of tiles.
pub(super) fn grid(camera: &Camera) -> [usize; 2] {
    [camera.width, camera.height].map(|side| (side as usize).div_ceil(TILE))
}

/// `struct View`.
pub(super) fn words(scene: &Scene, camera: &Camera, options: &RenderOptions, pairs: u32) -> [u32; VIEW_WORDS] {
    let mut words = [0; VIEW_WORDS];
    let mut put = |at: usize, values: &[f32]| {
        for (word, value) in words[at..].iter_mut().zip(values) {
            *word = value.to_bits();
        }
    };
    for row in 0..3 {
        put(4 * row, &camera.rotation.row(row).to_array());
    }
    let (scale, pinhole) = match camera.projection {
        Projection::Orthographic { pixels_per_unit } => (pixels_per_unit, 0),
        Projection::Pinhole { focal_px } => (focal_px, 1),
    };
    let keeps_weight = u32::from(matches!(options.filter, ScreenFilter::AntiAlias(_)));
    put(12, &camera.principal);
    put(14, &[scale, options.near.max(1e-12)]);
    put(16, &camera.jacobian_limit().map(|limit| limit.min(1e30)));
    put(18, &[options.filter.variance() as f32]);
    put(28, &options.background);
    let [columns, rows] = grid(camera);
    words[19] = pinhole | keeps_weight << 1;
    words[20..24].copy_from_slice(&[camera.width, camera.height, columns as u32, rows as u32]);
    words[24] = scene.len() as u32;
    words[25] = u32::from(scene.sh_degree);
    words[PAIRS] = pairs;
    words[27] = color_words(scene.sh_degree) as u32;
    words
}

/// Words of a Gaussian's colours.
pub(super) fn color_words(sh_degree: u8) -> usize {
    3 + sh::rest_count(sh_degree)
}

/// `array<Gaussian>`: geometry, with the centres in camera space. They are brought there in f64 and rounded once, as the
/// CPU does it, so that the order of depths is the CPU's and far coordinates keep their details.
pub(super) fn geometry(scene: &Scene, camera: &Camera) -> Vec<f32> {
    let rotation: DMat3 = camera.rotation.as_dmat3();
    let translation: DVec3 = camera.translation.as_dvec3();
    let mut words = vec![0.0; scene.len() * GAUSSIAN_WORDS];
    words
        .par_chunks_exact_mut(GAUSSIAN_WORDS)
        .with_min_len(4096)
        .enumerate()
        .for_each(|(i, out)| {
            // One that is not valid keeps its zeros, and with them the mark.
            if scene.is_valid(i) {
                let point = (rotation * scene.centers[i].as_dvec3() + translation).as_vec3();
                if !point.is_finite() {
                    return;
                }
                out[..3].copy_from_slice(&point.to_array());
                out[3] = scene.opacity_logits[i];
                out[4..7].copy_from_slice(&scene.log_scales[i].to_array());
                out[7] = 1.0;
                out[8..].copy_from_slice(&scene.rotations[i].to_array());
            }
        });
    words
}

/// For every Gaussian f_dc, then f_rest.
pub(super) fn harmonics(scene: &Scene) -> Vec<f32> {
    let stride = color_words(scene.sh_degree);
    let mut words = vec![0.0; scene.len() * stride];
    words
        .par_chunks_exact_mut(stride)
        .with_min_len(4096)
        .enumerate()
        .for_each(|(i, out)| {
            out[..3].copy_from_slice(&scene.sh_dc[i]);
            out[3..].copy_from_slice(scene.sh_rest_of(i));
        });
    words
}
