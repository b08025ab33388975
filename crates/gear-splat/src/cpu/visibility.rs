//! How much a camera sees of each Gaussian, for those who prune: the blend's walk, without colours.

use rayon::prelude::*;

use super::Frame;
use super::blend::{CHECK_EVERY, TileScene, is_finished};
use super::lanes::{self, HALF, LANE, LANES, PLANE_LEN, Plane, STRIDE};
use super::project::Splat;
use super::simd::simd_kernels;
use super::spans::Span;
use crate::render::TRANSMITTANCE_MIN;

/// The largest w = α T of every Gaussian of the scene at any pixel; 0 for those that add to none.
pub(super) fn largest_weights(frame: &Frame) -> Vec<f32> {
    largest(frame, |scene, planes, found| {
        scene.clear_transmittance(&mut planes.transmittance);
        weigh(frame.level, scene, planes, found);
    })
}

/// For every Gaussian of the scene, the largest Σ w over the Gaussians `of` at any pixel that it adds to.
pub(super) fn largest_sums(frame: &Frame, of: &[bool]) -> Vec<f32> {
    let of: Vec<bool> = frame.ids.iter().map(|&id| of[id as usize]).collect();
    largest(frame, |scene, planes, found| {
        scene.clear_transmittance(&mut planes.transmittance);
        planes.sums.fill(0.0);
        add_up(frame.level, scene, planes, &of);
        scene.clear_transmittance(&mut planes.transmittance);
        look_up(frame.level, scene, planes, found);
    })
}

/// A tile's transmittance, and the sums of its pixels.
#[repr(align(64))]
struct Planes {
    transmittance: Plane,
    sums: Plane,
}

/// What `walk` finds for the front of each tile's list, at its largest over the tiles, by scene index. The largest is the same
/// in whatever order it is looked for.
fn largest(frame: &Frame, walk: impl Fn(TileScene, &mut Planes, &mut Vec<f32>) + Sync) -> Vec<f32> {
    let bins = &frame.bins;
    let strips: Vec<(usize, (usize, usize))> = (0..bins.grid.columns * bins.grid.rows)
        .filter(|&tile| !bins.tile(tile).is_empty())
        .flat_map(|tile| bins.strips(tile).map(move |rows| (tile, rows)))
        .collect();
    let empty = || {
        Box::new(Planes {
            transmittance: [0.0; PLANE_LEN],
            sums: [0.0; PLANE_LEN],
        })
    };
    let found: Vec<(usize, Vec<f32>)> = strips
        .into_par_iter()
        .map_init(empty, |planes, (tile, rows)| {
            let mut found = Vec::new();
            walk(TileScene::new(frame, tile, rows), planes, &mut found);
            (tile, found)
        })
        .collect();
    let mut all = vec![0.0f32; frame.total];
    for (tile, found) in found {
        for (&rank, value) in bins.tile(tile).iter().zip(found) {
            let most = &mut all[frame.ids[rank as usize] as usize];
            *most = most.max(value);
        }
    }
    all
}

simd_kernels! {
    fn weigh(scene: TileScene, planes: &mut Planes, found: &mut Vec<f32>) {
        walk(scene, planes, |_, _, weights: &[f32], most: &mut [f32]| {
            for (most, &w) in most.iter_mut().zip(weights) {
                *most = if w > *most { w } else { *most };
            }
        }, |most| found.push(most));
    }

    fn add_up(scene: TileScene, planes: &mut Planes, of: &[bool]) {
        walk(scene, planes, |rank, sums: &mut [f32], weights: &[f32], _| {
            if of[rank] {
                for (sum, &w) in sums.iter_mut().zip(weights) {
                    *sum += w;
                }
            }
        }, |_| {});
    }

    fn look_up(scene: TileScene, planes: &mut Planes, found: &mut Vec<f32>) {
        walk(scene, planes, |_, sums: &mut [f32], weights: &[f32], most: &mut [f32]| {
            for ((most, &w), &sum) in most.iter_mut().zip(weights).zip(&*sums) {
                *most = if (w > 0.0) & (sum > *most) { sum } else { *most };
            }
        }, |most| found.push(most));
    }
}

/// Walks the tile's list as `blend` does. `group` gets a Gaussian's rank, the pixels' sums, its weights there, and the largest
/// found for it so far; `done` the largest of all its groups.
#[inline(always)]
fn walk(
    scene: TileScene,
    planes: &mut Planes,
    mut group: impl FnMut(usize, &mut [f32], &[f32], &mut [f32]),
    mut done: impl FnMut(f32),
) {
    let Planes { transmittance, sums } = planes;
    for (n, &rank) in scene.list.iter().enumerate() {
        if n % CHECK_EVERY == CHECK_EVERY - 1 && is_finished(transmittance) {
            return;
        }
        let rank = rank as usize;
        let splat = scene.splats[rank];
        let spans = scene.spans(&splat);
        let mut most = [0.0; LANES];
        for y in spans.rows.clone() {
            let span = spans.row(y);
            let mut x = span.first;
            while x < span.end {
                let (at, start) = (y * STRIDE + x, x as f32 - span.middle);
                if span.end - x > HALF {
                    if let Some(weights) = weights::<LANES>(&splat, &span, at, start, transmittance) {
                        group(rank, &mut sums[at..at + LANES], &weights, &mut most);
                    }
                    x += LANES;
                } else {
                    if let Some(weights) = weights::<HALF>(&splat, &span, at, start, transmittance) {
                        group(rank, &mut sums[at..at + HALF], &weights, &mut most);
                    }
                    x += HALF;
                }
            }
        }
        done(most.into_iter().fold(0.0, f32::max));
    }
}

/// Weights of `N` pixels from place `at` on, whose transmittance falls by them; `None` where all are finished.
#[inline(always)]
fn weights<const N: usize>(
    splat: &Splat,
    span: &Span,
    at: usize,
    start: f32,
    transmittance: &mut Plane,
) -> Option<[f32; N]> {
    let mut t = lanes::load::<N>(transmittance, at);
    if lanes::all_below(&t, TRANSMITTANCE_MIN) {
        return None;
    }
    let mut weights = [0.0; N];
    for l in 0..N {
        let weight = lanes::alpha(splat, span, start + LANE[l], t[l]) * t[l];
        t[l] -= weight;
        weights[l] = weight;
    }
    lanes::store(transmittance, at, &t);
    Some(weights)
}
