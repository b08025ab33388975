//! Stage 4: compositing, front to back.
//!
//! For each pixel, over its Gaussians in order of depth: w = α·T, output += w·feature, T ← T·(1 − α). A Gaussian
//! is left out where α < 1/255, and a pixel is finished once T < 1e-4. The loops are turned inside out: the outer
//! one walks the Gaussians of a tile, the inner one the pixels of the rows that the Gaussian covers, eight at a time,
//! on buffers of the tile that stay in the first-level cache. A Gaussian of six by six pixels costs six groups of
//! lanes, not a whole tile. What must stay true: every pixel meets its Gaussians in the order of the list, and
//! pixels outside the picture start with T = 0, so that they never receive anything.

use gear_image::{Field, Rgb};
use multiversion::multiversion;
use rayon::prelude::*;

use super::Frame;
use super::bin::{TILE_HEIGHT, TILE_WIDTH};
use super::lanes::{self, LANE, LANES, PLANE_LEN, Plane, STRIDE, TileSplat};
use super::project::{Splat, Surface};
use crate::render::{Outputs, Rendering, TRANSMITTANCE_MIN};

/// After so many Gaussians a tile looks whether all its pixels are finished.
pub(crate) const CHECK_EVERY: usize = 32;

/// What a tile accumulates.
struct TileBuffers {
    transmittance: Plane,
    color: [Plane; 3],
    /// Σ w, for the mean depth: 1 − T would have lost its small digits.
    weight: Plane,
    depth: Plane,
    median: Plane,
    normal: [Plane; 3],
}

/// What a tile reads.
#[derive(Clone, Copy)]
struct TileScene<'a> {
    splats: &'a [Splat],
    colors: &'a [[f32; 3]],
    surfaces: &'a [Surface],
    list: &'a [u32],
    left: usize,
    top: usize,
    columns: usize,
    rows: usize,
}

/// 1 inside the picture, 0 in the padding and beyond the picture's rim.
pub(crate) fn clear_transmittance(plane: &mut Plane, columns: usize, rows: usize) {
    plane.fill(0.0);
    for row in plane.chunks_exact_mut(STRIDE).take(rows) {
        row[..columns].fill(1.0);
    }
}

/// True when no pixel of the tile can receive anything.
#[inline(always)]
pub(crate) fn is_finished(transmittance: &Plane) -> bool {
    let mut alive = 0;
    for &t in transmittance {
        alive |= u32::from(t >= TRANSMITTANCE_MIN);
    }
    alive == 0
}

/// One compiled kernel for each combination of outputs, and within it one for each SIMD level.
macro_rules! kernels {
    ($($name:ident: $color:literal, $depth:literal, $normal:literal;)*) => {
        $(#[multiversion(targets = "simd")]
        fn $name(scene: TileScene, buffers: &mut TileBuffers) {
            blend::<$color, $depth, $normal>(scene, buffers);
        })*

        fn kernel(color: bool, depth: bool, normal: bool) -> fn(TileScene, &mut TileBuffers) {
            match (color, depth, normal) {
                $(($color, $depth, $normal) => $name,)*
            }
        }
    };
}

kernels! {
    blend_coverage: false, false, false;
    blend_color: true, false, false;
    blend_depth: false, true, false;
    blend_normal: false, false, true;
    blend_color_depth: true, true, false;
    blend_color_normal: true, false, true;
    blend_depth_normal: false, true, true;
    blend_color_depth_normal: true, true, true;
}

#[inline(always)]
fn blend<const COLOR: bool, const DEPTH: bool, const NORMAL: bool>(scene: TileScene, buffers: &mut TileBuffers) {
    let TileBuffers {
        transmittance,
        color: [red, green, blue],
        weight: weights,
        depth,
        median,
        normal: [nx, ny, nz],
    } = buffers;
    for (n, &i) in scene.list.iter().enumerate() {
        if n % CHECK_EVERY == CHECK_EVERY - 1 && is_finished(transmittance) {
            return;
        }
        let i = i as usize;
        let splat = scene.splats[i];
        let color = if COLOR { scene.colors[i] } else { [0.0; 3] };
        let surface = if DEPTH || NORMAL {
            scene.surfaces[i]
        } else {
            Surface::default()
        };
        let seen = TileSplat::new(&splat, scene.left, scene.top, scene.rows);
        for y in seen.rows() {
            let Some(span) = seen.row(y, scene.columns) else {
                continue;
            };
            // Depth of the surfel's plane at the middle column of this row.
            let row_offset = surface.slope[1] * span.dy + surface.slope[0] * (span.middle - seen.mean[0]);
            let mut x = span.first;
            while x <= span.last {
                let at = y * STRIDE + x;
                let start = x as f32 - span.middle;
                x += LANES;
                let t = lanes::at(transmittance, at);
                if lanes::all_below(t, TRANSMITTANCE_MIN) {
                    continue;
                }
                let (r, g, b) = (lanes::at(red, at), lanes::at(green, at), lanes::at(blue, at));
                let (sum, z_sum, z_median) = (lanes::at(weights, at), lanes::at(depth, at), lanes::at(median, at));
                let (n_x, n_y, n_z) = (lanes::at(nx, at), lanes::at(ny, at), lanes::at(nz, at));
                // One loop for everything: short separate ones are unrolled before they can become vectors.
                for l in 0..LANES {
                    let along = start + LANE[l];
                    let before = t[l];
                    let alpha = lanes::alpha(&splat, &span, along, before);
                    let weight = alpha * before;
                    let after = before * (1.0 - alpha);
                    t[l] = after;
                    if COLOR {
                        r[l] += weight * color[0];
                        g[l] += weight * color[1];
                        b[l] += weight * color[2];
                    }
                    if DEPTH {
                        let offset = row_offset + surface.slope[0] * along;
                        let offset = if offset < surface.reach { offset } else { surface.reach };
                        let offset = if offset > -surface.reach {
                            offset
                        } else {
                            -surface.reach
                        };
                        let z = surface.depth + offset;
                        sum[l] += weight;
                        z_sum[l] += weight * z;
                        // T falls, so this holds for one Gaussian.
                        let crosses = (before > 0.5) & (after <= 0.5);
                        z_median[l] = if crosses { z } else { z_median[l] };
                    }
                    if NORMAL {
                        n_x[l] += weight * surface.normal[0];
                        n_y[l] += weight * surface.normal[1];
                        n_z[l] += weight * surface.normal[2];
                    }
                }
            }
        }
    }
}

/// Pictures under construction; planes that are not wanted are empty.
struct Canvas {
    rgb: Vec<[f32; 3]>,
    alpha: Vec<f32>,
    depth: Vec<f32>,
    median: Vec<f32>,
    normal: Vec<[f32; 3]>,
}

/// The part of a [`Canvas`] that one row of tiles covers.
struct Band<'a> {
    rgb: &'a mut [[f32; 3]],
    alpha: &'a mut [f32],
    depth: &'a mut [f32],
    median: &'a mut [f32],
    normal: &'a mut [[f32; 3]],
}

pub(crate) fn draw(frame: &Frame) -> Rendering {
    let outputs = frame.outputs;
    let grid = frame.bins.grid;
    let pixels = grid.width * grid.height;
    let wants_depth = outputs.depth || outputs.median_depth;
    let kernel = kernel(outputs.rgb, wants_depth, outputs.normal);
    let len = |wanted: bool| if wanted { pixels } else { 0 };
    let mut canvas = Canvas {
        rgb: vec![[0.0; 3]; len(outputs.rgb)],
        alpha: vec![0.0; len(outputs.alpha)],
        depth: vec![0.0; len(outputs.depth)],
        median: vec![0.0; len(outputs.median_depth)],
        normal: vec![[0.0; 3]; len(outputs.normal)],
    };
    canvas
        .bands(grid.width)
        .into_par_iter()
        .enumerate()
        .for_each(|(row, mut band)| {
            let mut buffers = Box::new(TileBuffers::new());
            for column in 0..grid.columns {
                let scene = TileScene {
                    splats: &frame.splats,
                    colors: &frame.colors,
                    surfaces: &frame.surfaces,
                    list: frame.bins.tile(row * grid.columns + column),
                    left: column * TILE_WIDTH,
                    top: row * TILE_HEIGHT,
                    columns: TILE_WIDTH.min(grid.width - column * TILE_WIDTH),
                    rows: TILE_HEIGHT.min(grid.height - row * TILE_HEIGHT),
                };
                buffers.clear(outputs, scene.columns, scene.rows);
                kernel(scene, &mut buffers);
                band.take(&buffers, &scene, grid.width, frame.background);
            }
        });
    canvas.finish(grid.width, grid.height, outputs)
}

impl TileBuffers {
    fn new() -> Self {
        const ZERO: Plane = [0.0; PLANE_LEN];
        Self {
            transmittance: ZERO,
            color: [ZERO; 3],
            weight: ZERO,
            depth: ZERO,
            median: ZERO,
            normal: [ZERO; 3],
        }
    }

    fn clear(&mut self, outputs: Outputs, columns: usize, rows: usize) {
        clear_transmittance(&mut self.transmittance, columns, rows);
        if outputs.rgb {
            self.color.iter_mut().for_each(|plane| plane.fill(0.0));
        }
        if outputs.depth || outputs.median_depth {
            self.weight.fill(0.0);
            self.depth.fill(0.0);
            self.median.fill(f32::NAN);
        }
        if outputs.normal {
            self.normal.iter_mut().for_each(|plane| plane.fill(0.0));
        }
    }
}

impl Canvas {
    fn bands(&mut self, width: usize) -> Vec<Band<'_>> {
        let len = width * TILE_HEIGHT;
        let count = [
            self.rgb.len(),
            self.alpha.len(),
            self.depth.len(),
            self.median.len(),
            self.normal.len(),
        ]
        .into_iter()
        .max()
        .map_or(0, |pixels| pixels.div_ceil(len.max(1)));
        let mut rgb = self.rgb.chunks_mut(len.max(1));
        let mut alpha = self.alpha.chunks_mut(len.max(1));
        let mut depth = self.depth.chunks_mut(len.max(1));
        let mut median = self.median.chunks_mut(len.max(1));
        let mut normal = self.normal.chunks_mut(len.max(1));
        (0..count)
            .map(|_| Band {
                rgb: rgb.next().unwrap_or_default(),
                alpha: alpha.next().unwrap_or_default(),
                depth: depth.next().unwrap_or_default(),
                median: median.next().unwrap_or_default(),
                normal: normal.next().unwrap_or_default(),
            })
            .collect()
    }

    fn finish(self, width: usize, height: usize, outputs: Outputs) -> Rendering {
        let field = |wanted: bool, data| wanted.then(|| Field::from_vec(width, height, data));
        Rendering {
            rgb: outputs.rgb.then(|| Rgb::from_vec(width, height, self.rgb)),
            alpha: field(outputs.alpha, self.alpha),
            depth: field(outputs.depth, self.depth),
            median_depth: field(outputs.median_depth, self.median),
            normal: outputs.normal.then_some(self.normal),
        }
    }
}

impl Band<'_> {
    /// Copies a tile's result into the band.
    fn take(&mut self, tile: &TileBuffers, scene: &TileScene, width: usize, background: [f32; 3]) {
        for y in 0..scene.rows {
            for x in 0..scene.columns {
                let at = y * STRIDE + x;
                let to = y * width + scene.left + x;
                let transmittance = tile.transmittance[at];
                let coverage = 1.0 - transmittance;
                if let Some(rgb) = self.rgb.get_mut(to) {
                    *rgb = std::array::from_fn(|c| tile.color[c][at] + transmittance * background[c]);
                }
                if let Some(alpha) = self.alpha.get_mut(to) {
                    *alpha = coverage;
                }
                if let Some(depth) = self.depth.get_mut(to) {
                    let weight = tile.weight[at];
                    *depth = if weight > 0.0 {
                        tile.depth[at] / weight
                    } else {
                        f32::NAN
                    };
                }
                if let Some(median) = self.median.get_mut(to) {
                    *median = tile.median[at];
                }
                if let Some(normal) = self.normal.get_mut(to) {
                    let n: [f32; 3] = std::array::from_fn(|c| tile.normal[c][at]);
                    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
                    *normal = if length > 0.0 { n.map(|x| x / length) } else { [0.0; 3] };
                }
            }
        }
    }
}
