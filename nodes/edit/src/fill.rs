//! Colours for what the painter did not see: layout from the rendered view, detail from the painting.
//!
//! 1. The scene still has its grounded colours. One sliced-OT map, learnt where both are known, at the canonical
//!    camera, brings them to the painting's; it is the same for every view, so that views agree, and a side on which
//!    only blue cloth is seen stays blue cloth.
//! 2. Its low-pass is the layout. Near known pixels it is shifted by the blurred difference to them, so that the
//!    border does not show.
//! 3. PatchMatch on the low-pass colour lends the painting's detail layer.

use gear_image::filter::{gaussian, gaussian_rgb};
use gear_image::{Field, Mask, SrgbImage};
use rayon::prelude::*;

use crate::patch_match::Exemplar;
use crate::random;
use crate::reproject::Known;
use crate::sliced_ot::SlicedOt;

/// Samples on either side of the colour map.
const SAMPLES: usize = 20_000;
/// How much wider the correction towards known pixels reaches than the low-pass.
const CORRECTION: f64 = 6.0;

/// How it is filled; see the node's parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recipe {
    /// Parts layout from detail, pixels.
    pub sigma: f64,
    /// Random rotations of colour space.
    pub rotations: u32,
    /// Side of a patch, pixels.
    pub patch: usize,
    /// Rounds in which patches are looked for.
    pub rounds: u32,
    /// Seed of rotations and patches.
    pub seed: u64,
}

/// What all views share.
pub(crate) struct Filler {
    map: SlicedOt,
    exemplar: Exemplar,
    recipe: Recipe,
}

impl Filler {
    /// Learns colours from `front`, the scene at the canonical camera, and detail from the painting, inside `mask`.
    pub fn new(front: &SrgbImage, painting: &SrgbImage, mask: &Mask, recipe: Recipe) -> Self {
        let rotations = (0..u64::from(recipe.rotations)).map(|i| random::rotation(recipe.seed, i));
        let map = SlicedOt::fit(&samples(front, mask), &samples(painting, mask), rotations);
        let low = low_pass(painting, mask, recipe.sigma);
        Self {
            map,
            exemplar: Exemplar::new(painting, low, mask, recipe.patch / 2),
            recipe,
        }
    }

    /// Colours for the whole silhouette of a view; meaningful where the painting does not tell all.
    pub fn fill(&self, rendered: &SrgbImage, known: &Known) -> SrgbImage {
        let silhouette = &known.silhouette;
        let (width, height) = silhouette.size();
        let mapped = |(c, &inside): (&[f32; 3], &bool)| {
            if inside {
                self.map.apply(c.map(f64::from)).map(|v| v.clamp(0.0, 1.0) as f32)
            } else {
                [0.0; 3]
            }
        };
        let pixels: Vec<_> = rendered.data().par_iter().zip(silhouette.data()).map(mapped).collect();
        let mut layout = low_pass(
            &SrgbImage::from_vec(width, height, pixels),
            silhouette,
            self.recipe.sigma,
        );
        self.meet(&mut layout, known);
        let todo = (0..silhouette.len()).map(|i| silhouette.data()[i] && known.share(i) < 1.0);
        let todo = Mask::from_vec(width, height, todo.collect());
        let detail = self
            .exemplar
            .detail(&layout, &todo, self.recipe.rounds, self.recipe.seed);
        for (low, high) in layout.data_mut().iter_mut().zip(detail.data()) {
            for (l, h) in low.iter_mut().zip(high) {
                *l += h;
            }
        }
        layout
    }

    /// Shifts the layout to the known colours near them: + G(w (known − layout))/G(w), fading with distance.
    fn meet(&self, layout: &mut SrgbImage, known: &Known) {
        let (width, height) = layout.size();
        let share = (0..layout.len()).map(|i| {
            if known.silhouette.data()[i] {
                known.share(i)
            } else {
                0.0
            }
        });
        let share = Field::from_vec(width, height, share.collect());
        let gap = layout.data().iter().zip(known.colour.data()).zip(share.data());
        let gap = gap.map(|((l, t), w)| std::array::from_fn(|c| w * (t[c] - l[c])));
        let gap = SrgbImage::from_vec(width, height, gap.collect());
        let reach = CORRECTION * self.recipe.sigma;
        let gap = gaussian_rgb(&gap, reach);
        let near = gaussian(&share, reach);
        for ((l, g), n) in layout.data_mut().iter_mut().zip(gap.data()).zip(near.data()) {
            let fade = (2.0 * n).min(1.0) / n.max(1e-4);
            for (l, g) in l.iter_mut().zip(g) {
                *l += fade * g;
            }
        }
    }
}

/// Colours inside the mask, at most [`SAMPLES`] of them, evenly taken.
fn samples(picture: &SrgbImage, mask: &Mask) -> Vec<[f64; 3]> {
    let stride = mask.count().div_ceil(SAMPLES).max(1);
    let inside = picture.data().iter().zip(mask.data()).filter(|(_, m)| **m);
    inside.step_by(stride).map(|(c, _)| c.map(f64::from)).collect()
}

/// Gaussian mean over the mask's pixels only.
fn low_pass(picture: &SrgbImage, mask: &Mask, sigma: f64) -> SrgbImage {
    let (width, height) = picture.size();
    let masked = picture.data().iter().zip(mask.data());
    let masked = masked.map(|(c, &m)| if m { *c } else { [0.0; 3] }).collect();
    let mut low = gaussian_rgb(&SrgbImage::from_vec(width, height, masked), sigma);
    let weight = gaussian(&mask.to_field(), sigma);
    for (c, w) in low.data_mut().iter_mut().zip(weight.data()) {
        *c = c.map(|v| v / w.max(1e-3));
    }
    low
}
