//! Stage 4: compositing, front to back.
//!
//! For each pixel, over its Gaussians in order of depth: w = α·T, output += w·feature, T ← T − w. A Gaussian
//! is left out where α < 1/255, and a pixel is finished once T < 1e-4. The loops are turned inside out: the outer
//! one walks the Gaussians of a tile, the inner one the pixels of the rows that the Gaussian covers, sixteen or eight at a
//! time, on buffers of the tile that stay in the first-level cache. A Gaussian of six by six pixels costs six groups of
//! eight lanes, not a whole tile. What must stay true: every pixel meets its Gaussians in the order of the list, and
//! pixels outside the picture start with T = 0, so that they never receive anything.

use super::Frame;
use super::bin::{TILE_HEIGHT, TILE_WIDTH};
use super::canvas::{self, Finished};
use super::lanes::{self, HALF, LANE, LANES, PLANE_LEN, Plane, STRIDE};
use super::project::Splat;
use super::simd::{SimdLevel, simd_kernels};
use super::spans::{Span, Spans};
use super::surface::Surface;
use crate::render::{Outputs, Rendering, TRANSMITTANCE_MIN};

/// After so many Gaussians a tile looks whether all its pixels are finished.
pub(crate) const CHECK_EVERY: usize = 32;

/// What a tile accumulates.
#[repr(align(64))]
pub(crate) struct TileBuffers {
    pub transmittance: Plane,
    color: [Plane; 3],
    /// Σ w (z − z₀), with z₀ the depth of the tile's foremost Gaussian.
    pub depth: Plane,
    median: Plane,
    pub normal: [Plane; 3],
}

/// What a tile reads.
#[derive(Clone, Copy)]
pub(crate) struct TileScene<'a> {
    pub splats: &'a [Splat],
    pub colors: &'a [[f32; 3]],
    pub surfaces: &'a [Surface],
    /// Gaussians, front to back.
    pub list: &'a [u32],
    pub left: usize,
    pub top: usize,
    /// How many columns the picture leaves the tile.
    pub columns: usize,
    /// Rows that are worked on: the first, and the one after the last.
    pub rows: (usize, usize),
    /// Depth of the foremost Gaussian. Depths are summed from there, since the sum of weights is taken as 1 − T: its
    /// rounding then scales with the depths' spread, not with the distance from the camera.
    pub foremost: f32,
}

impl<'a> TileScene<'a> {
    pub fn new(frame: &'a Frame, tile: usize, rows: (usize, usize)) -> Self {
        let grid = &frame.bins.grid;
        let (left, top) = (tile % grid.columns * TILE_WIDTH, tile / grid.columns * TILE_HEIGHT);
        let list = frame.bins.tile(tile);
        let first = list.first().and_then(|&i| frame.surfaces.get(i as usize));
        Self {
            splats: &frame.splats,
            colors: &frame.colors,
            surfaces: &frame.surfaces,
            foremost: first.map_or(0.0, |surface| surface.depth),
            list,
            left,
            top,
            columns: TILE_WIDTH.min(grid.width - left),
            rows,
        }
    }

    #[inline(always)]
    pub fn spans(&self, splat: &Splat) -> Spans {
        Spans::new(splat, self.left, self.top, self.rows, self.columns)
    }

    /// 1 in the pixels that are worked on, 0 elsewhere.
    pub fn clear_transmittance(&self, plane: &mut Plane) {
        plane.fill(0.0);
        let (first, end) = self.rows;
        for row in plane.chunks_exact_mut(STRIDE).take(end).skip(first) {
            row[..self.columns].fill(1.0);
        }
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

/// One kernel for each combination of outputs.
macro_rules! kernels {
    ($($name:ident: $color:literal, $depth:literal, $median:literal, $normal:literal;)*) => {
        simd_kernels! {
            $(fn $name(scene: TileScene, buffers: &mut TileBuffers) {
                blend::<$color, $depth, $median, $normal>(scene, buffers);
            })*
        }

        /// The kernel for some outputs.
        pub(crate) fn kernel(outputs: Outputs) -> fn(SimdLevel, TileScene, &mut TileBuffers) {
            match (outputs.rgb, outputs.depth, outputs.median_depth, outputs.normal) {
                $(($color, $depth, $median, $normal) => $name,)*
            }
        }
    };
}

kernels! {
    blend_coverage: false, false, false, false;
    blend_color: true, false, false, false;
    blend_depth: false, true, false, false;
    blend_median: false, false, true, false;
    blend_normal: false, false, false, true;
    blend_color_depth: true, true, false, false;
    blend_color_median: true, false, true, false;
    blend_color_normal: true, false, false, true;
    blend_depth_median: false, true, true, false;
    blend_depth_normal: false, true, false, true;
    blend_median_normal: false, false, true, true;
    blend_color_depth_median: true, true, true, false;
    blend_color_depth_normal: true, true, false, true;
    blend_color_median_normal: true, false, true, true;
    blend_depth_median_normal: false, true, true, true;
    blend_all: true, true, true, true;
}

/// What one Gaussian adds to the pixels of one row.
#[derive(Clone, Copy)]
struct Stroke {
    splat: Splat,
    span: Span,
    color: [f32; 3],
    surface: Surface,
    /// Offset of the surfel's plane at the middle column of this row.
    row_offset: f32,
    /// Depth of its centre behind the tile's foremost.
    behind: f32,
}

#[inline(always)]
fn blend<const COLOR: bool, const DEPTH: bool, const MEDIAN: bool, const NORMAL: bool>(
    scene: TileScene,
    buffers: &mut TileBuffers,
) {
    for (n, &i) in scene.list.iter().enumerate() {
        if n % CHECK_EVERY == CHECK_EVERY - 1 && is_finished(&buffers.transmittance) {
            return;
        }
        let i = i as usize;
        let splat = scene.splats[i];
        let color = if COLOR { scene.colors[i] } else { [0.0; 3] };
        let surface = if DEPTH || MEDIAN || NORMAL {
            scene.surfaces[i]
        } else {
            Surface::default()
        };
        let spans = scene.spans(&splat);
        for y in spans.rows.clone() {
            let span = spans.row(y);
            let stroke = Stroke {
                splat,
                span,
                color,
                surface,
                row_offset: surface.slope[1] * span.dy + surface.slope[0] * (span.middle - spans.mean[0]),
                behind: surface.depth - scene.foremost,
            };
            let mut x = span.first;
            while x < span.end {
                let at = y * STRIDE + x;
                let start = x as f32 - span.middle;
                if span.end - x > HALF {
                    group::<LANES, COLOR, DEPTH, MEDIAN, NORMAL>(&stroke, at, start, buffers);
                    x += LANES;
                } else {
                    group::<HALF, COLOR, DEPTH, MEDIAN, NORMAL>(&stroke, at, start, buffers);
                    x += HALF;
                }
            }
        }
    }
}

/// `N` pixels from place `at` of the tile's planes on, which lies `start` from the middle of the span.
#[inline(always)]
fn group<const N: usize, const COLOR: bool, const DEPTH: bool, const MEDIAN: bool, const NORMAL: bool>(
    stroke: &Stroke,
    at: usize,
    start: f32,
    buffers: &mut TileBuffers,
) {
    let TileBuffers {
        transmittance,
        color: [red, green, blue],
        depth,
        median,
        normal: [nx, ny, nz],
    } = buffers;
    let Stroke { color, surface, .. } = *stroke;
    let mut t = lanes::load::<N>(transmittance, at);
    if lanes::all_below(&t, TRANSMITTANCE_MIN) {
        return;
    }
    // Copies, so that the compiler sees that no two of them overlap.
    let mut c = [lanes::load::<N>(red, at), lanes::load(green, at), lanes::load(blue, at)];
    let (mut z_sum, mut z_median) = (lanes::load::<N>(depth, at), lanes::load::<N>(median, at));
    let mut n = [lanes::load::<N>(nx, at), lanes::load(ny, at), lanes::load(nz, at)];
    // One loop for everything: short separate ones are unrolled before they can become vectors.
    for l in 0..N {
        let along = start + LANE[l];
        let before = t[l];
        let weight = lanes::alpha(&stroke.splat, &stroke.span, along, before) * before;
        let after = before - weight;
        t[l] = after;
        if COLOR {
            c[0][l] += weight * color[0];
            c[1][l] += weight * color[1];
            c[2][l] += weight * color[2];
        }
        if DEPTH || MEDIAN {
            let offset = surface.offset(stroke.row_offset + surface.slope[0] * along);
            if DEPTH {
                z_sum[l] += weight * (stroke.behind + offset);
            }
            if MEDIAN {
                // T falls, so this holds for one Gaussian.
                let crosses = (before > 0.5) & (after <= 0.5);
                z_median[l] = if crosses { surface.depth + offset } else { z_median[l] };
            }
        }
        if NORMAL {
            n[0][l] += weight * surface.normal[0];
            n[1][l] += weight * surface.normal[1];
            n[2][l] += weight * surface.normal[2];
        }
    }
    lanes::store(transmittance, at, &t);
    if COLOR {
        lanes::store(red, at, &c[0]);
        lanes::store(green, at, &c[1]);
        lanes::store(blue, at, &c[2]);
    }
    if DEPTH {
        lanes::store(depth, at, &z_sum);
    }
    if MEDIAN {
        lanes::store(median, at, &z_median);
    }
    if NORMAL {
        lanes::store(nx, at, &n[0]);
        lanes::store(ny, at, &n[1]);
        lanes::store(nz, at, &n[2]);
    }
}

pub(crate) fn draw(frame: &Frame) -> Rendering {
    let outputs = frame.outputs;
    let kernel = kernel(outputs);
    canvas::paint(&frame.bins, outputs, TileBuffers::new, |buffers, patch| {
        let scene = TileScene::new(frame, patch.tile, patch.rows);
        buffers.clear(outputs, &scene);
        kernel(frame.level, scene, buffers);
        finish(
            frame.level,
            buffers,
            outputs,
            frame.background,
            scene.foremost,
            scene.rows,
        );
        patch.write(&buffers.finished());
    })
}

impl TileBuffers {
    pub fn new() -> Box<Self> {
        const ZERO: Plane = [0.0; PLANE_LEN];
        Box::new(Self {
            transmittance: ZERO,
            color: [ZERO; 3],
            depth: ZERO,
            median: ZERO,
            normal: [ZERO; 3],
        })
    }

    pub fn clear(&mut self, outputs: Outputs, scene: &TileScene) {
        scene.clear_transmittance(&mut self.transmittance);
        if outputs.rgb {
            self.color.iter_mut().for_each(|plane| plane.fill(0.0));
        }
        if outputs.depth {
            self.depth.fill(0.0);
        }
        if outputs.median_depth {
            self.median.fill(f32::NAN);
        }
        if outputs.normal {
            self.normal.iter_mut().for_each(|plane| plane.fill(0.0));
        }
    }

    fn finished(&self) -> Finished<'_> {
        Finished {
            rgb: &self.color,
            alpha: &self.transmittance,
            depth: &self.depth,
            median: &self.median,
            normal: &self.normal,
        }
    }
}

simd_kernels! {
    /// Turns the sums of a tile's rows into pictures: the background shines through, depths and normals become means, and
    /// transmittance becomes coverage.
    fn finish(buffers: &mut TileBuffers, outputs: Outputs, background: [f32; 3], foremost: f32, rows: (usize, usize)) {
        let TileBuffers { transmittance, color, depth, normal: [nx, ny, nz], .. } = buffers;
        for y in rows.0..rows.1 {
            let t = columns(transmittance, y);
            if outputs.rgb {
                for (plane, background) in color.iter_mut().zip(background) {
                    for (x, t) in columns(plane, y).iter_mut().zip(&*t) {
                        *x += t * background;
                    }
                }
            }
            for t in t.iter_mut() {
                *t = 1.0 - *t;
            }
            if outputs.depth {
                for (z, weight) in columns(depth, y).iter_mut().zip(&*t) {
                    let mean = foremost + *z / weight;
                    *z = if *weight > 0.0 { mean } else { f32::NAN };
                }
            }
            if outputs.normal {
                let [nx, ny, nz] = [columns(nx, y), columns(ny, y), columns(nz, y)];
                for i in 0..TILE_WIDTH {
                    let length = length([nx[i], ny[i], nz[i]]);
                    let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
                    nx[i] *= scale;
                    ny[i] *= scale;
                    nz[i] *= scale;
                }
            }
        }
    }
}

/// Row `y` of a plane without the padding.
#[inline(always)]
fn columns(plane: &mut Plane, y: usize) -> &mut [f32; TILE_WIDTH] {
    let row = &mut plane[y * STRIDE..y * STRIDE + TILE_WIDTH];
    row.try_into().expect("the slice has that length")
}

/// Length of a vector.
#[inline(always)]
pub(crate) fn length(n: [f32; 3]) -> f32 {
    (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt()
}
