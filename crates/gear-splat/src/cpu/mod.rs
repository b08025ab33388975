//! The rasteriser on the CPU, forward and backward.
//!
//! Stages, in the order data passes them:
//!
//! 1. `project`: every Gaussian becomes an ellipse on the screen (f64 inside, f32 out), with the size at which
//!    its α falls below 1/255; those that touch no pixel are counted and left out.
//! 2. `sort`: the seen ones are ordered by the depth of their centre, stably, and stored in that order: from here on a
//!    Gaussian is its rank. `color` and `surface` add what the wanted pictures need.
//! 3. `bin`: each tile of 32 × 16 pixels gets its list, front to back.
//! 4. `blend`: each tile composites its list, over the row `spans` of each ellipse, into the pictures that are wanted.
//! 5. `blend_backward`: given the loss's derivatives by the pixels, each tile sums the derivatives by the ellipses,
//!    walking its list front to back again; the sums of a Gaussian's tiles are added in tile order.
//! 6. `project_backward`: derivatives by the ellipse become derivatives by centre, scale, rotation, opacity and colour.
//!
//! A [`Frame`] holds the results of 1 to 3. They do not depend on colours, so that an optimiser that moves only
//! colours keeps its frames and repeats stages 4 and 5 only.
//!
//! The bits do not depend on the number of threads: work is split into tiles and fixed chunks, a tile (or a strip of
//! a crowded one) is worked on by one thread in the order of its list, and sums over tiles run in tile order. Nor do
//! they depend on the SIMD level: see [`SimdLevel`].

mod bin;
mod blend;
mod blend_backward;
mod canvas;
mod color;
mod lanes;
mod math;
mod project;
mod project_backward;
pub(crate) mod simd;
mod sort;
mod spans;
mod surface;
mod visibility;
mod work;

pub use simd::SimdLevel;
pub use work::Work;

use crate::render::{Counts, Outputs, PixelGradients, RenderOptions, Rendering, SceneGradients, Wanted};
use crate::{Camera, Scene};
use bin::{Bins, Grid};
use project::Splat;
use surface::Surface;

/// A scene seen by a camera, ready to be drawn.
pub struct Frame {
    level: SimdLevel,
    camera: Camera,
    view: project::View,
    background: [f32; 3],
    outputs: Outputs,
    counts: Counts,
    /// Number of Gaussians in the scene.
    total: usize,
    /// Whether colours depend on the direction of view.
    directional: bool,
    /// The seen Gaussians, front to back.
    splats: Vec<Splat>,
    /// Their indices in the scene.
    ids: Vec<u32>,
    /// Their colours; empty unless colour is wanted.
    colors: Vec<[f32; 3]>,
    /// Their planes; empty unless depth or normals are wanted.
    surfaces: Vec<Surface>,
    bins: Bins,
}

impl Frame {
    /// Projects, sorts and bins the scene.
    ///
    /// # Panics
    /// When the scene is ragged ([`Scene::validate`]): a caller's bug.
    pub fn new(scene: &Scene, camera: &Camera, options: &RenderOptions, outputs: Outputs) -> Self {
        Self::with_simd(scene, camera, options, outputs, SimdLevel::current())
    }

    /// [`Frame::new`] at a SIMD level, or at the best that this CPU has if it lacks that. The result is the same, to the
    /// bit.
    ///
    /// # Panics
    /// As [`Frame::new`].
    pub fn with_simd(
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
        outputs: Outputs,
        level: SimdLevel,
    ) -> Self {
        if let Err(error) = scene.validate() {
            panic!("{error}");
        }
        let level = level.min(SimdLevel::best());
        let view = project::View::new(camera, options);
        let needs_surfaces = outputs.depth || outputs.median_depth || outputs.normal;
        let seen = project::project(scene, &view, needs_surfaces, level);
        let keys: Vec<&[sort::Key]> = seen.chunks().iter().map(|chunk| chunk.keys.as_slice()).collect();
        let ids = sort::front_to_back(&keys);
        let splats = seen.splats(&ids);
        let surfaces = if needs_surfaces {
            seen.surfaces(&ids)
        } else {
            Vec::new()
        };
        let grid = Grid::new(camera.width as usize, camera.height as usize);
        Self {
            level,
            camera: *camera,
            background: options.background,
            outputs,
            counts: seen.counts,
            total: scene.len(),
            directional: scene.sh_degree > 0,
            colors: if outputs.rgb {
                color::colors(scene, camera, &ids)
            } else {
                Vec::new()
            },
            bins: Bins::new(grid, &splats, level),
            view,
            splats,
            ids,
            surfaces,
        }
    }

    /// Takes the scene's colours anew. Everything else of the scene must be as it was.
    pub fn recolor(&mut self, scene: &Scene) {
        if self.outputs.rgb {
            self.colors = color::colors(scene, &self.camera, &self.ids);
        }
    }

    /// The pictures that were wanted.
    pub fn draw(&self) -> Rendering {
        blend::draw(self)
    }

    /// Derivatives of a loss by the scene, from its derivatives by the pixels of `rendering`, which must be what
    /// [`Frame::draw`] gave. Median depth has no derivative: it jumps from one surfel to another.
    ///
    /// # Panics
    /// When a picture that has gradients was not wanted, or a gradient has not one entry a pixel: a caller's bug.
    pub fn backward(
        &self,
        scene: &Scene,
        rendering: &Rendering,
        pixels: &PixelGradients,
        wanted: Wanted,
    ) -> SceneGradients {
        for (name, given, drawn) in [
            ("rgb", !pixels.rgb.is_empty(), rendering.rgb.is_some()),
            ("alpha", !pixels.alpha.is_empty(), rendering.alpha.is_some()),
            ("depth", !pixels.depth.is_empty(), self.outputs.depth),
            ("normal", !pixels.normal.is_empty(), self.outputs.normal),
        ] {
            assert!(
                !given || drawn,
                "a gradient by `{name}` needs that picture among the outputs"
            );
        }
        let sums = blend_backward::sum_tiles(self, rendering, pixels, wanted);
        project_backward::to_scene(self, scene, &sums, wanted)
    }

    /// Whether a gradient needs the sums for colours: for themselves, or because colours change with the direction in which a
    /// pinhole sees the centres.
    fn needs_color_sums(&self, wanted: Wanted) -> bool {
        wanted.colors || wanted.centers && self.directional && self.view.is_pinhole()
    }

    /// What became of the scene's Gaussians.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Number of (tile, Gaussian) pairs.
    pub fn pairs(&self) -> usize {
        self.bins.len()
    }

    /// The largest weight w = T α of every Gaussian of the scene at any pixel, by its index; 0 for those that this camera does
    /// not see. Needs no output.
    pub fn largest_weights(&self) -> Vec<f32> {
        visibility::largest_weights(self)
    }

    /// For every Gaussian of the scene, the largest Σ w over the Gaussians that `of` marks at any pixel that it adds to; 0
    /// for those that this camera does not see.
    ///
    /// # Panics
    /// When `of` has not one entry for each Gaussian of the scene: a caller's bug.
    pub fn largest_sums(&self, of: &[bool]) -> Vec<f32> {
        assert_eq!(of.len(), self.total, "one mark a Gaussian");
        visibility::largest_sums(self, of)
    }

    /// Counts the work that [`Frame::draw`] does, pixel by pixel. Slow.
    pub fn work(&self) -> Work {
        work::count(self)
    }
}
