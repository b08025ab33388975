//! The rasteriser on the GPU, forward and backward, in `wgpu` compute. Twin of [`crate::cpu`], stage by stage.
//!
//! 1. `project.wgsl`: every Gaussian becomes an ellipse on the screen, and counts the tiles of 16 × 16 pixels it touches.
//! 2. `sort.wgsl`: all are ordered by the depth of their centre, stably.
//! 3. `bin.wgsl`, `find.wgsl`: every (tile, Gaussian) pair gets a slot; the slots are sorted by tile.
//! 4. `blend.wgsl`: a workgroup composites a tile.
//! 5. `blend_backward.wgsl`: a workgroup walks a tile again and leaves each pair's sums in the pair's slot.
//! 6. `project_backward.wgsl`: the slots of a Gaussian are added up, and the chain rule leads back to the scene.
//!
//! No kernel uses an atomic, a subgroup operation, or a wait for another workgroup, so that one adapter with one
//! driver gives the same bits on every run, and no driver can deadlock. No kernel uses more than eight storage
//! buffers, 16 KiB of workgroup memory or 256 threads, which WebGPU promises everywhere. A buffer that the adapter does not
//! hold is a [`GpuError`], found before anything is computed with it.
//!
//! The host waits twice: for the number of pairs, which decides the size of buffers, and for the pictures.

/// The parts of a WGSL module.
macro_rules! module {
    ($($part:literal),*) => { &[$(include_str!($part)),*] };
}

mod adapter;
mod backward;
mod device;
mod scan;
mod sort;
mod view;

use std::sync::Arc;

use wgpu::Buffer;

use crate::render::{Outputs, RenderOptions, Rendering};
use crate::{Camera, Scene};
use device::{Kernel, Recording};
use gear_image::{Field, Rgb};
use sort::Sorted;

pub(crate) use adapter::may_be_there;
pub use adapter::{AdapterName, names};
pub use device::{Gpu, GpuError};

/// Side of a tile in pixels.
const TILE: usize = 16;
/// Gaussians a workgroup handles in the kernels that take one a thread.
const BLOCK: usize = 256;
/// Words of `Splat` and of `Surface`.
const SPLAT_WORDS: usize = 8;
const SURFACE_WORDS: usize = 8;

const PROJECT: Kernel = Kernel {
    constants: &["SURFACES"],
    ..Kernel::new(
        module!(
            "common.wgsl",
            "footprint.wgsl",
            "plane.wgsl",
            "tiles.wgsl",
            "surface.wgsl",
            "project.wgsl"
        ),
        "project",
    )
};
const COLOR: Kernel = Kernel::new(
    module!(
        "common.wgsl",
        "footprint.wgsl",
        "sh.wgsl",
        "raw_color.wgsl",
        "color.wgsl"
    ),
    "color",
);
const BIN: &[&str] = module!("common.wgsl", "tiles.wgsl", "bin.wgsl");
const OFFSET: Kernel = Kernel::new(BIN, "offset");
const EMIT: Kernel = Kernel::new(BIN, "emit");
const FIND: Kernel = Kernel::new(module!("common.wgsl", "find.wgsl"), "find");
const BLEND: Kernel = Kernel {
    constants: &["COLOR", "ALPHA", "DEPTH", "MEDIAN", "NORMAL", "SUMS"],
    ..Kernel::new(
        module!("common.wgsl", "tiles.wgsl", "surface.wgsl", "blend.wgsl"),
        "blend",
    )
};

/// A scene seen by a camera, ready to be drawn: on the GPU what [`crate::cpu::Frame`] is on the CPU.
pub struct Frame {
    gpu: Arc<Gpu>,
    outputs: Outputs,
    background: [f32; 3],
    size: [usize; 2],
    count: usize,
    pairs: usize,
    /// `struct View`.
    view: Buffer,
    gaussians: Buffer,
    harmonics: Buffer,
    splats: Buffer,
    colors: Buffer,
    surfaces: Buffer,
    /// Gaussians front to back, and the first slot of each.
    order: Buffer,
    offsets: Buffer,
    /// The Gaussian of each slot.
    owners: Buffer,
    /// Slots sorted by tile; where each tile begins, and how far it was walked when it was drawn.
    slots: Buffer,
    ranges: Buffer,
}

impl Frame {
    /// Projects, sorts and bins the scene.
    ///
    /// # Panics
    /// When the scene is ragged ([`Scene::validate`]): a caller's bug.
    pub fn new(
        gpu: &Arc<Gpu>,
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
        outputs: Outputs,
    ) -> Result<Self, GpuError> {
        if let Err(error) = scene.validate() {
            panic!("{error}");
        }
        gpu.check()?;
        let count = scene.len();
        let [columns, rows] = view::grid(camera);
        let tiles = columns * rows;
        let view = gpu.uniform(&view::words(scene, camera, options, 0));
        let gaussians = gpu.upload(&at_least_one(view::geometry(scene, camera)))?;
        let splats = gpu.buffer(count.max(1) * SPLAT_WORDS)?;
        let needs_surfaces = outputs.depth || outputs.median_depth || outputs.normal;
        let surfaces = gpu.buffer(if needs_surfaces { count.max(1) } else { 1 } * SURFACE_WORDS)?;
        let counts = gpu.buffer(count)?;
        let unsorted = Sorted {
            keys: gpu.buffer(count)?,
            items: gpu.buffer(count)?,
        };

        let mut recording = gpu.record();
        let buffers = [
            (0, &view),
            (1, &gaussians),
            (2, &splats),
            (3, &unsorted.keys),
            (4, &unsorted.items),
            (5, &counts),
            (6, &surfaces),
        ];
        let project = Kernel {
            switches: needs_surfaces.into(),
            ..PROJECT
        };
        recording.run(project, count.div_ceil(BLOCK), &buffers);
        let order = sort::stable(&mut recording, unsorted, count, u32::BITS)?.items;
        let offsets = gpu.buffer(count + 1)?;
        let buffers = [(0, &view), (1, &order), (2, &counts), (4, &offsets)];
        recording.run(OFFSET, count.div_ceil(BLOCK), &buffers);
        scan::exclusive(&mut recording, &offsets, count + 1)?;
        recording.submit();

        let total = gpu.read::<u32>(&[(&offsets, 4 * count as u64)])?[0][0];
        gpu.write(&view, &view::words(scene, camera, options, total));
        let pairs = total as usize;
        let owners = gpu.buffer(pairs)?;
        let unsorted = Sorted {
            keys: gpu.buffer(pairs)?,
            items: gpu.buffer(pairs)?,
        };
        let mut recording = gpu.record();
        let buffers = [
            (0, &view),
            (1, &order),
            (3, &splats),
            (4, &offsets),
            (5, &unsorted.keys),
            (6, &unsorted.items),
            (7, &owners),
        ];
        recording.run(EMIT, count.div_ceil(BLOCK), &buffers);
        let bits = usize::BITS - tiles.leading_zeros();
        let sorted = sort::stable(&mut recording, unsorted, pairs, bits)?;
        let ranges = gpu.buffer(2 * (tiles + 1))?;
        let buffers = [(0, &view), (1, &sorted.keys), (2, &ranges)];
        recording.run(FIND, (tiles + 1).div_ceil(BLOCK), &buffers);

        let stride = view::color_words(scene.sh_degree);
        let colored = if outputs.rgb { count.max(1) } else { 1 };
        let frame = Self {
            gpu: Arc::clone(gpu),
            outputs,
            background: options.background,
            size: [camera.width as usize, camera.height as usize],
            count,
            pairs,
            gaussians,
            harmonics: gpu.buffer(colored * stride)?,
            splats,
            colors: gpu.buffer(colored * 4)?,
            surfaces,
            order,
            offsets,
            owners,
            slots: sorted.items,
            ranges,
            view,
        };
        frame.color(&mut recording, scene);
        recording.submit();
        gpu.check()?;
        Ok(frame)
    }

    /// Takes the scene's colours anew. Everything else of the scene must be as it was.
    pub fn recolor(&mut self, scene: &Scene) {
        let mut recording = self.gpu.record();
        self.color(&mut recording, scene);
        recording.submit();
    }

    fn color(&self, recording: &mut Recording, scene: &Scene) {
        if self.outputs.rgb {
            self.gpu.write(&self.harmonics, &view::harmonics(scene));
            let buffers = [
                (0, &self.view),
                (1, &self.gaussians),
                (2, &self.harmonics),
                (3, &self.colors),
            ];
            recording.run(COLOR, self.count.div_ceil(BLOCK), &buffers);
        }
    }

    /// The pictures that were wanted.
    pub fn draw(&self) -> Result<Rendering, GpuError> {
        let pixels = self.blend(planes(self.outputs))?;
        Ok(self.rendering(&pixels))
    }

    /// Runs `blend` for some planes of `pictures`.
    fn blend(&self, planes: [usize; 6]) -> Result<Vec<f32>, GpuError> {
        let pixels = self.size[0] * self.size[1];
        let pictures = self.gpu.buffer(planes.iter().sum::<usize>() * pixels)?;
        let bits = planes.iter().enumerate();
        let switches = bits.map(|(bit, &planes)| u32::from(planes > 0) << bit).sum();
        let mut recording = self.gpu.record();
        let buffers = [
            (0, &self.view),
            (1, &self.splats),
            (2, &self.colors),
            (3, &self.surfaces),
            (4, &self.owners),
            (5, &self.slots),
            (6, &self.ranges),
            (7, &pictures),
        ];
        recording.run(Kernel { switches, ..BLEND }, self.tiles(), &buffers);
        recording.submit();
        Ok(self.gpu.read::<f32>(&[(&pictures, 0)])?.remove(0))
    }

    fn tiles(&self) -> usize {
        self.size.map(|side| side.div_ceil(TILE)).into_iter().product()
    }

    fn rendering(&self, pictures: &[f32]) -> Rendering {
        let [width, height] = self.size;
        let mut planes = Planes(pictures.chunks_exact((width * height).max(1)));
        let outputs = self.outputs;
        let rgb = outputs.rgb.then(|| planes.three());
        let mut field = |wanted: bool| wanted.then(|| Field::from_vec(width, height, planes.one().to_vec()));
        Rendering {
            rgb: rgb.map(|rgb| Rgb::from_vec(width, height, rgb)),
            alpha: field(outputs.alpha),
            depth: field(outputs.depth),
            median_depth: field(outputs.median_depth),
            normal: outputs.normal.then(|| planes.three()),
        }
    }

    /// Number of (tile, Gaussian) pairs.
    pub fn pairs(&self) -> usize {
        self.pairs
    }
}

/// The planes of `pictures`, one after the other.
struct Planes<'a>(std::slice::ChunksExact<'a, f32>);

impl<'a> Planes<'a> {
    fn one(&mut self) -> &'a [f32] {
        self.0.next().unwrap_or_default()
    }

    fn three(&mut self) -> Vec<[f32; 3]> {
        let [x, y, z] = [self.one(), self.one(), self.one()];
        x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]).collect()
    }
}

/// Σ w and |Σ w n|, for the gradient.
const SUMS: [usize; 6] = [0, 0, 0, 0, 0, 2];

/// Planes of each output, in the order of `pictures` in blend.wgsl.
fn planes(outputs: Outputs) -> [usize; 6] {
    [
        3 * usize::from(outputs.rgb),
        outputs.alpha.into(),
        outputs.depth.into(),
        outputs.median_depth.into(),
        3 * usize::from(outputs.normal),
        0,
    ]
}

/// A binding holds at least one element.
fn at_least_one(mut words: Vec<f32>) -> Vec<f32> {
    if words.is_empty() {
        words.resize(16, 0.0);
    }
    words
}
