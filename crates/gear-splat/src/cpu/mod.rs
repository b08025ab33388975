//! The rasteriser on the CPU, forward and backward.
//!
//! Stages, in the order data passes them:
//!
//! 1. `project`: every Gaussian becomes an ellipse on the screen (f64 inside, f32 out), with the radius at which
//!    its α falls below 1/255; those that touch no pixel are marked.
//! 2. `sort`: the seen ones are ordered by the depth of their centre, stably.
//! 3. `bin`: each tile of 32 × 16 pixels gets its list, front to back.
//! 4. `blend`: each tile composites its list into the pictures that are wanted.
//! 5. `gradient`: given the loss's derivatives by the pixels, each tile sums the derivatives by the ellipses,
//!    walking its list front to back again; the sums of a Gaussian's tiles are added in tile order.
//! 6. `chain`: derivatives by the ellipse become derivatives by centre, scale, rotation, opacity and colour.
//!
//! A [`Frame`] holds the results of 1 to 3. They do not depend on colours, so that an optimiser that moves only
//! colours keeps its frames and repeats stages 4 and 5 only.
//!
//! The bits do not depend on the number of threads: work is split into tiles and fixed chunks, a tile is worked
//! on by one thread in the order of its list, and sums over tiles run in tile order.

mod bin;
mod blend;
mod chain;
mod gradient;
mod lanes;
mod project;
mod sort;

use rayon::prelude::*;

use crate::render::{Outputs, PixelGradients, RenderOptions, Rendering, SceneGradients, Wanted};
use crate::{Camera, Scene};
use bin::{Bins, Grid};
use project::{Splat, Surface};

/// A scene seen by a camera, ready to be drawn.
pub struct Frame {
    camera: Camera,
    view: project::View,
    background: [f32; 3],
    outputs: Outputs,
    splats: Vec<Splat>,
    bins: Bins,
    colors: Vec<[f32; 3]>,
    /// Empty unless depth or normals are wanted.
    surfaces: Vec<Surface>,
}

impl Frame {
    /// Projects, sorts and bins the scene.
    ///
    /// # Panics
    /// When the scene is ragged ([`Scene::validate`]): a caller's bug.
    pub fn new(scene: &Scene, camera: &Camera, options: &RenderOptions, outputs: Outputs) -> Self {
        if let Err(error) = scene.validate() {
            panic!("{error}");
        }
        let view = project::View::new(camera, options);
        let (width, height) = (camera.width as usize, camera.height as usize);
        let (splats, depths) = project::project(scene, &view, [width, height]);
        let seen = (0..scene.len() as u32)
            .filter(|&i| splats[i as usize].is_seen())
            .collect();
        let order = sort::front_to_back(seen, &depths);
        let bins = Bins::new(Grid::new(width, height), &splats, &order);
        let needs_surfaces = outputs.depth || outputs.median_depth || outputs.normal;
        let surface = |i: usize| {
            let seen = splats[i].is_seen();
            seen.then(|| view.surface(scene, i, camera))
                .flatten()
                .unwrap_or_default()
        };
        let surfaces = if needs_surfaces {
            (0..scene.len())
                .into_par_iter()
                .with_min_len(1024)
                .map(surface)
                .collect()
        } else {
            Vec::new()
        };
        Self {
            camera: *camera,
            background: options.background,
            outputs,
            colors: if outputs.rgb {
                project::colors(scene, camera, &splats)
            } else {
                Vec::new()
            },
            view,
            splats,
            bins,
            surfaces,
        }
    }

    /// Takes the scene's colours anew. Everything else of the scene must be as it was.
    pub fn recolor(&mut self, scene: &Scene) {
        if self.outputs.rgb {
            self.colors = project::colors(scene, &self.camera, &self.splats);
        }
    }

    /// The pictures that were wanted.
    pub fn draw(&self) -> Rendering {
        blend::draw(self)
    }

    /// Derivatives of a loss by the scene, from its derivatives by the pixels of `rendering`, which must be what
    /// [`Frame::draw`] gave with colour and coverage wanted.
    ///
    /// # Panics
    /// When colour or coverage is missing, or a gradient has not one entry a pixel: a caller's bug.
    pub fn backward(
        &self,
        scene: &Scene,
        rendering: &Rendering,
        pixels: &PixelGradients,
        wanted: Wanted,
    ) -> SceneGradients {
        let sums = gradient::sum_tiles(self, rendering, pixels, wanted);
        chain::to_scene(self, scene, &sums, wanted)
    }

    /// Number of Gaussians that touch the picture.
    pub fn seen(&self) -> usize {
        self.splats.iter().filter(|splat| splat.is_seen()).count()
    }

    /// Number of (tile, Gaussian) pairs.
    pub fn pairs(&self) -> usize {
        self.bins.entries.len()
    }
}
