//! Counts what the blend does: the bound on work that does not depend on the machine.

use rayon::prelude::*;

use super::Frame;
use super::blend::{CHECK_EVERY, TileScene, is_finished};
use super::lanes::{self, HALF, LANE, LANES, PLANE_LEN, Plane, STRIDE};
use super::project::Splat;
use super::spans::Span;
use crate::render::TRANSMITTANCE_MIN;

/// Work of one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// (pixel, Gaussian) pairs that add to the picture: α ≥ 1/255 and T ≥ 1e-4.
    pub contributing: u64,
    /// Pixels of row spans that were looked at.
    pub evaluated: u64,
    /// SIMD lanes that were computed, masked ones included.
    pub lanes: u64,
}

/// Walks all lists as the blend does.
pub(super) fn count(frame: &Frame) -> Work {
    let tiles = frame.bins.grid.columns * frame.bins.grid.rows;
    let parts: Vec<Work> = (0..tiles)
        .into_par_iter()
        .map(|tile| {
            let mut work = Work::default();
            for rows in frame.bins.strips(tile) {
                count_strip(&TileScene::new(frame, tile, rows), &mut work);
            }
            work
        })
        .collect();
    parts.into_iter().fold(Work::default(), |a, b| Work {
        contributing: a.contributing + b.contributing,
        evaluated: a.evaluated + b.evaluated,
        lanes: a.lanes + b.lanes,
    })
}

fn count_strip(scene: &TileScene, work: &mut Work) {
    let mut transmittance = [0.0; PLANE_LEN];
    scene.clear_transmittance(&mut transmittance);
    for (n, &i) in scene.list.iter().enumerate() {
        if n % CHECK_EVERY == CHECK_EVERY - 1 && is_finished(&transmittance) {
            return;
        }
        let splat = scene.splats[i as usize];
        let spans = scene.spans(&splat);
        for y in spans.rows.clone() {
            let span = spans.row(y);
            let mut x = span.first;
            while x < span.end {
                let (at, start) = (y * STRIDE + x, x as f32 - span.middle);
                let left = (span.end - x) as u64;
                if left > HALF as u64 {
                    count_group::<LANES>(&splat, &span, at, start, left, &mut transmittance, work);
                    x += LANES;
                } else {
                    count_group::<HALF>(&splat, &span, at, start, left, &mut transmittance, work);
                    x += HALF;
                }
            }
        }
    }
}

fn count_group<const N: usize>(
    splat: &Splat,
    span: &Span,
    at: usize,
    start: f32,
    left: u64,
    transmittance: &mut Plane,
    work: &mut Work,
) {
    let mut t = lanes::load::<N>(transmittance, at);
    if lanes::all_below(&t, TRANSMITTANCE_MIN) {
        return;
    }
    work.lanes += N as u64;
    work.evaluated += left.min(N as u64);
    for l in 0..N {
        let alpha = lanes::alpha(splat, span, start + LANE[l], t[l]);
        work.contributing += u64::from(alpha > 0.0);
        t[l] -= alpha * t[l];
    }
    lanes::store(transmittance, at, &t);
}
