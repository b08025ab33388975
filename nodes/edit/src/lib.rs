//! Appearance targets: the painting as each view should show it.
//!
//! For every rendered view, the painting is carried over through the known geometry to what the painter saw
//! (`reproject`). What the painter did not see is filled: colours of the scene harmonised to the painting's by sliced
//! optimal transport, with detail lent by PatchMatch (`fill`, `sliced_ot`, `patch_match`). Both are blended with the
//! weight of the facing angle. A view that looks along the painter's own rays is the painting itself, bit for bit, on
//! the mask. Where nothing is seen the target is the view's white ground.
//!
//! It stands for the paper's image editor D(R_k, T_a). It knows nothing of what things are: an unseen side gets
//! plausible colour and texture, never a drawn ear.

mod fill;
mod patch_match;
mod random;
mod reproject;
mod sliced_ot;
mod target;

use std::borrow::Cow;
use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Registry, Want};
use gear_image::{Image, Mask, SrgbImage, colour};
use gear_splat::{Camera, RenderOptions, Scene, View, Views};
use rayon::prelude::*;

use crate::fill::{Filler, Recipe};
use crate::reproject::Source;
use crate::target::{Buffers, Told, Trust};

pub use sliced_ot::SlicedOt;

/// Appearance targets: every view with the painting's look.
///
/// What the painter saw is carried over through the geometry, the rest is filled with the painting's colours and
/// texture. `weight` of a target says how far each pixel may be trusted.
#[derive(Clone, Debug, Params)]
pub struct Edit {
    /// How far the depths of one point may differ between a view and the canonical one.
    #[param(default = 0.005, range = 0.0..=1.0, unit = "share of the longer side")]
    pub tolerance: f64,
    /// Blur that parts layout, which comes from the scene, from detail, which comes from the painting.
    #[param(default = 0.006, range = 0.0005..=0.2, unit = "share of the longer side")]
    pub layout: f64,
    /// Side of the patches that lend detail.
    #[param(default = 7, range = 3..=31, unit = "px")]
    pub patch: usize,
    /// Random rotations of colour space along which the scene's colours are brought to the painting's.
    #[param(default = 20, range = 0..=10_000)]
    pub color_rotations: u32,
    /// Rounds in which patches are looked for.
    #[param(default = 4, range = 0..=1000)]
    pub patch_rounds: u32,
    /// Blur of the border between seen and unseen.
    #[param(default = 0.004, range = 0.0..=0.1, unit = "share of the longer side")]
    pub feather: f64,
    /// Trust in a back that mirrors its front.
    #[param(default = 0.5, range = 0.0..=1.0)]
    pub trust_back: f64,
    /// Trust in what was filled.
    #[param(default = 0.3, range = 0.0..=1.0)]
    pub trust_fill: f64,
    /// Seed of the random searches, the same for every view.
    #[param(default = 0, range = 0..=1000000)]
    pub seed: u64,
}

/// What is edited, and what with.
#[derive(Inputs)]
pub struct In {
    /// Rendered views with coverage, depth and normals.
    pub views: Arc<Views>,
    /// The scene that they show, with its canonical camera.
    pub scene: Arc<Scene>,
    /// The painting.
    pub painting: Arc<Image>,
    /// What of the painting is the subject, the same size.
    pub mask: Arc<Mask>,
}

/// The targets.
#[derive(Outputs)]
pub struct Out {
    /// The views with edited colours and a weight for every pixel; cameras, coverage, depth and normals as they came.
    pub targets: Arc<Views>,
}

impl Node for Edit {
    const NAME: &str = "Edit";
    const VERSION: u32 = 3;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let painting = &*finite(&inputs.painting.rgb);
        if inputs.mask.size() != painting.size() {
            return Err(sizes("mask", inputs.mask.size(), painting.size()));
        }
        let camera = canonical(&inputs.scene, painting.size())?;
        let front = gear_splat::render(
            &inputs.scene,
            &camera,
            &RenderOptions::default(),
            gear_splat::Outputs::ALL,
        );
        let (Some(depth), Some(front)) = (front.surface_depth(), front.rgb) else {
            return Err(NodeError::new("the renderer gave no depth for the canonical camera"));
        };
        let longer = painting.longer_side() as f64;
        let source = Source {
            painting,
            mask: &inputs.mask,
            camera,
            depth,
            tolerance_px: (self.tolerance * longer).max(1.0) as f32,
            feather_px: (self.feather * longer).max(1.0),
        };
        let trust = Trust {
            back: self.trust_back as f32,
            fill: self.trust_fill as f32,
        };
        let views = &inputs.views.views;
        let told: Result<Vec<Told>, NodeError> = views
            .par_iter()
            .map(|view| {
                ctx.checkpoint()?;
                Ok(Told::of(&source, view, &buffers(view)?))
            })
            .collect();
        let told = told?;
        ctx.progress(0.3);
        // Fully seen views need neither colour map nor patches.
        let filler = told.iter().any(|told| !told.is_complete()).then(|| {
            let recipe = Recipe {
                sigma: (self.layout * longer).max(0.8),
                rotations: self.color_rotations,
                patch: self.patch,
                rounds: self.patch_rounds,
                seed: self.seed,
            };
            Filler::new(&front, painting, &inputs.mask, recipe)
        });
        ctx.progress(0.5);
        let targets: Result<Vec<View>, NodeError> = told
            .into_par_iter()
            .zip(views)
            .map(|(told, view)| {
                ctx.checkpoint()?;
                Ok(target::target(
                    told,
                    view,
                    buffers(view)?.alpha,
                    &trust,
                    filler.as_ref(),
                ))
            })
            .collect();
        Ok(Out {
            targets: Arc::new(Views { views: targets? }),
        })
    }
}

/// The painting, with samples that are no numbers made black and infinite ones bright: a target has neither.
fn finite(painting: &SrgbImage) -> Cow<'_, SrgbImage> {
    if painting.data().as_flattened().iter().all(|x| x.is_finite()) {
        return Cow::Borrowed(painting);
    }
    let mut painting = painting.clone();
    for sample in painting.data_mut().as_flattened_mut() {
        if !sample.is_finite() {
            *sample = colour::sanitise_sample(*sample);
        }
    }
    Cow::Owned(painting)
}

/// The buffers that a view must come with, of its colour's size.
fn buffers(view: &View) -> Result<Buffers<'_>, NodeError> {
    let missing = |what: &str| {
        NodeError::input(
            "views",
            format!(
                "view `{}` has no {what}; render the views with coverage, depth and normals",
                view.name
            ),
        )
    };
    let buffers = Buffers {
        alpha: view.alpha.as_ref().ok_or_else(|| missing("coverage"))?,
        depth: view.depth.as_ref().ok_or_else(|| missing("depth"))?,
        normal: view.normal.as_ref().ok_or_else(|| missing("normals"))?,
    };
    let size = view.rgb.size();
    if buffers.alpha.size() != size || buffers.depth.size() != size || buffers.normal.len() != view.rgb.len() {
        return Err(missing("buffers of one size"));
    }
    Ok(buffers)
}

/// The scene's canonical camera at the painting's size.
fn canonical(scene: &Scene, size: (usize, usize)) -> Result<Camera, NodeError> {
    let camera = scene.canonical_camera.ok_or_else(|| {
        NodeError::input(
            "scene",
            "it has no canonical camera, so nobody knows where the painting lies on it; use a scene from Reconstruct",
        )
    })?;
    let camera = camera.resized(size.0.max(size.1) as u32);
    let seen = (camera.width as usize, camera.height as usize);
    if seen == size {
        Ok(camera)
    } else {
        Err(sizes("scene", seen, size))
    }
}

fn sizes(port: &str, found: (usize, usize), painting: (usize, usize)) -> NodeError {
    NodeError::input(
        port,
        format!(
            "it is for a picture of {}×{} pixels, the painting has {}×{}; both must come from the same painting",
            found.0, found.1, painting.0, painting.1
        ),
    )
}

/// Registers the node.
pub fn register(registry: &mut Registry) {
    registry.node::<Edit>();
}

#[cfg(test)]
mod tests;
