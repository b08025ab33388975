//! The pyramid's two passes.
//!
//! Down: each level keeps w and R. Level 0 is not stored: w_0 follows from the edge map, R_0 is the input; the
//! first halving reads both once and writes quarter-size planes, so that the whole descent costs little more than
//! one pass over the input.
//!
//! Up: two planes of the coarser level, v and vM, are interpolated along y into one row, then along x while the
//! finer row is blended. Cell-centred interpolation by 2 has only the weights ¼ and ¾: fine sample 2j lies
//! between coarse j−1 and j, fine 2j+1 between j and j+1, clamped at the rim.
//!
//! What must stay true: all weights non-negative, each quotient by the sum of the same weights. Then every
//! value is a convex combination of inputs, and a constant stays a constant.

use gear_image::{Field, stats};
use multiversion::multiversion;
use rayon::prelude::*;

/// Number of levels for which the coarsest shorter side is at least 8, in 1..=7.
pub(crate) fn automatic(width: usize, height: usize) -> usize {
    let side = width.min(height);
    if side < 8 {
        1
    } else {
        (1 + (side / 8).ilog2() as usize).min(7)
    }
}

/// A level below the finest: R and the summed weights w, on a grid of cells.
struct Level {
    width: usize,
    height: usize,
    ratio: Vec<f32>,
    weight: Vec<f32>,
}

/// R_ms of `ratio` under the edge map `edges` of the same size (values outside [0, 1] are clamped, NaN is 0).
///
/// Samples of `ratio` that are not finite are taken as 0 (NaN) or as ±1e30.
pub fn multiscale(ratio: &Field, edges: &Field, levels: usize, kappa: f32, tau: f32) -> Field {
    assert_eq!(ratio.size(), edges.size(), "the edge map has the ratio's size");
    let (width, height) = ratio.size();
    if ratio.is_empty() {
        return ratio.clone();
    }
    let (low, high) = clamped_range(ratio);
    let mut pyramid: Vec<Level> = Vec::new();
    for _ in 1..levels {
        let (w, h) = pyramid
            .last()
            .map_or((width, height), |level| (level.width, level.height));
        if w.min(h) < 2 {
            break;
        }
        let source = match pyramid.last() {
            None => Source {
                ratio: ratio.data(),
                weight: Weight::Edges(edges.data(), kappa),
                width: w,
                height: h,
            },
            Some(l) => Source {
                ratio: &l.ratio,
                weight: Weight::Stored(&l.weight),
                width: w,
                height: h,
            },
        };
        pyramid.push(halve(&source));
    }
    // Up, from the coarsest: M replaces R in place, then turns into v·M beside v for the next finer level.
    for l in (0..pyramid.len()).rev() {
        let (fine, coarse) = pyramid.split_at_mut(l + 1);
        let fine = &mut fine[l];
        shares(fine, l + 1, width, height);
        if let Some(coarse) = coarse.first() {
            let Level {
                width, ratio, weight, ..
            } = fine;
            ratio
                .par_chunks_mut(*width)
                .zip(weight.par_chunks(*width))
                .enumerate()
                .for_each_init(Vec::new, |rows, (y, (ratio, share))| {
                    let (v, vm) = interpolated_rows(coarse, y, rows);
                    blend_row(ratio, share, v, vm, tau);
                });
        }
        fine.ratio.iter_mut().zip(&fine.weight).for_each(|(m, v)| *m *= v);
    }
    let mut out = Field::filled(width, height, 0.0);
    out.data_mut()
        .par_chunks_mut(width)
        .enumerate()
        .for_each_init(Vec::new, |rows, (y, out)| {
            finest_row(
                ratio.row(y),
                out,
                low,
                high,
                Edge {
                    row: edges.row(y),
                    kappa,
                },
                pyramid.first(),
                y,
                rows,
                tau,
            );
        });
    out
}

fn clamped_range(ratio: &Field) -> (f32, f32) {
    let (low, high) = stats::range(ratio.data()).unwrap_or((0.0, 0.0));
    (finite(low), finite(high))
}

#[inline(always)]
fn finite(x: f32) -> f32 {
    let x = if x.is_nan() { 0.0 } else { x };
    x.clamp(-1e30, 1e30)
}

/// w_0 = 1/(1 + κE).
#[inline(always)]
fn boundary_weight(edge: f32, kappa: f32) -> f32 {
    let edge = if edge > 0.0 { edge } else { 0.0 };
    let edge = if edge < 1.0 { edge } else { 1.0 };
    1.0 / (1.0 + kappa * edge)
}

enum Weight<'a> {
    Edges(&'a [f32], f32),
    Stored(&'a [f32]),
}

struct Source<'a> {
    ratio: &'a [f32],
    weight: Weight<'a>,
    width: usize,
    height: usize,
}

/// The next coarser level: sums over 2×2 cells; cells at an odd rim have fewer pixels.
fn halve(source: &Source<'_>) -> Level {
    let (width, height) = (source.width.div_ceil(2), source.height.div_ceil(2));
    let mut ratio = vec![0.0f32; width * height];
    let mut weight = vec![0.0f32; width * height];
    ratio
        .par_chunks_mut(width)
        .zip(weight.par_chunks_mut(width))
        .enumerate()
        .for_each_init(
            || (Vec::new(), Vec::new()),
            |(w_row, wr_row), (y, (ratio, weight))| {
                w_row.clear();
                w_row.resize(width * 2, 0.0);
                wr_row.clear();
                wr_row.resize(width * 2, 0.0);
                for line in 2 * y..(2 * y + 2).min(source.height) {
                    let span = line * source.width..(line + 1) * source.width;
                    let r = &source.ratio[span.clone()];
                    match &source.weight {
                        Weight::Edges(edges, kappa) => add_edge_line(&edges[span], *kappa, r, w_row, wr_row),
                        Weight::Stored(weights) => add_line(&weights[span], r, w_row, wr_row),
                    }
                }
                pair_cells(w_row, wr_row, ratio, weight);
            },
        );
    Level {
        width,
        height,
        ratio,
        weight,
    }
}

#[multiversion(targets = "simd")]
fn add_edge_line(edges: &[f32], kappa: f32, ratio: &[f32], w_row: &mut [f32], wr_row: &mut [f32]) {
    let n = edges.len();
    let (ratio, w_row, wr_row) = (&ratio[..n], &mut w_row[..n], &mut wr_row[..n]);
    for x in 0..n {
        let w = boundary_weight(edges[x], kappa);
        w_row[x] += w;
        wr_row[x] += w * finite(ratio[x]);
    }
}

#[multiversion(targets = "simd")]
fn add_line(weights: &[f32], ratio: &[f32], w_row: &mut [f32], wr_row: &mut [f32]) {
    let n = weights.len();
    let (ratio, w_row, wr_row) = (&ratio[..n], &mut w_row[..n], &mut wr_row[..n]);
    for x in 0..n {
        w_row[x] += weights[x];
        wr_row[x] += weights[x] * ratio[x];
    }
}

#[multiversion(targets = "simd")]
fn pair_cells(w_row: &[f32], wr_row: &[f32], ratio: &mut [f32], weight: &mut [f32]) {
    let (w_row, _) = w_row.as_chunks::<2>();
    let (wr_row, _) = wr_row.as_chunks::<2>();
    for (((ratio, weight), w), wr) in ratio.iter_mut().zip(weight.iter_mut()).zip(w_row).zip(wr_row) {
        *weight = w[0] + w[1];
        *ratio = (wr[0] + wr[1]) / *weight;
    }
}

/// Turns summed weights into v = w / pixels of the cell. Level `l` has cells of 2ˡ×2ˡ pixels, cut by the rim.
fn shares(level: &mut Level, l: usize, width: usize, height: usize) {
    let extent = |i: usize, n: usize| (((i + 1) << l).min(n) - (i << l)) as f32;
    let w = level.width;
    level.weight.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
        let rows = extent(y, height);
        for (x, weight) in row.iter_mut().enumerate() {
            *weight /= rows * extent(x, width);
        }
    });
}

/// v and v·M of the coarser level at the height of fine row `y`, in `rows`.
fn interpolated_rows<'a>(coarse: &Level, y: usize, rows: &'a mut Vec<f32>) -> (&'a [f32], &'a [f32]) {
    let n = coarse.width;
    let (a, b) = neighbours(y, coarse.height);
    rows.resize(2 * n, 0.0);
    let (v, vm) = rows.split_at_mut(n);
    mix_rows(&coarse.weight[a * n..][..n], &coarse.weight[b * n..][..n], v);
    mix_rows(&coarse.ratio[a * n..][..n], &coarse.ratio[b * n..][..n], vm);
    (v, vm)
}

/// The coarse samples around fine sample `i`: (the one with weight ¾, the one with ¼).
#[inline(always)]
fn neighbours(i: usize, n: usize) -> (usize, usize) {
    let near = i / 2;
    let far = if i.is_multiple_of(2) {
        near.saturating_sub(1)
    } else {
        (near + 1).min(n - 1)
    };
    (near, far)
}

#[multiversion(targets = "simd")]
fn mix_rows(near: &[f32], far: &[f32], out: &mut [f32]) {
    for ((out, a), b) in out.iter_mut().zip(near).zip(far) {
        *out = 0.75 * a + 0.25 * b;
    }
}

/// M at one fine sample, given the coarse neighbours in x.
#[inline(always)]
fn blend(r: f32, share: f32, v: [f32; 2], vm: [f32; 2], tau: f32) -> f32 {
    let up = (0.75 * vm[0] + 0.25 * vm[1]) / (0.75 * v[0] + 0.25 * v[1]);
    let t = 1.0 - (1.0 - tau) * share;
    up + t * (r - up)
}

/// Replaces a row of R by M.
#[multiversion(targets = "simd")]
fn blend_row(ratio: &mut [f32], share: &[f32], v: &[f32], vm: &[f32], tau: f32) {
    let n = v.len();
    let at = |x: usize, far: usize| ([v[x], v[far]], [vm[x], vm[far]]);
    let inner = ratio.len() / 2;
    for x in 0..inner {
        let (a, b) = (at(x, x.saturating_sub(1)), at(x, (x + 1).min(n - 1)));
        ratio[2 * x] = blend(ratio[2 * x], share[2 * x], a.0, a.1, tau);
        ratio[2 * x + 1] = blend(ratio[2 * x + 1], share[2 * x + 1], b.0, b.1, tau);
    }
    if ratio.len() % 2 == 1 {
        let (v, vm) = at(inner, inner.saturating_sub(1));
        ratio[2 * inner] = blend(ratio[2 * inner], share[2 * inner], v, vm, tau);
    }
}

struct Edge<'a> {
    row: &'a [f32],
    kappa: f32,
}

#[allow(clippy::too_many_arguments)] // one row of everything that the finest level reads
fn finest_row(
    ratio: &[f32],
    out: &mut [f32],
    low: f32,
    high: f32,
    edge: Edge<'_>,
    coarse: Option<&Level>,
    y: usize,
    rows: &mut Vec<f32>,
    tau: f32,
) {
    copy_finite(ratio, out);
    if let Some(coarse) = coarse {
        let mut share = vec![0.0f32; ratio.len()];
        boundary_weights(edge.row, edge.kappa, &mut share);
        let (v, vm) = interpolated_rows(coarse, y, rows);
        blend_row(out, &share, v, vm, tau);
    }
    // Rounding may leave the range of the input by an ulp.
    clamp_row(out, low, high);
}

#[multiversion(targets = "simd")]
fn copy_finite(from: &[f32], to: &mut [f32]) {
    for (to, &x) in to.iter_mut().zip(from) {
        *to = finite(x);
    }
}

#[multiversion(targets = "simd")]
fn boundary_weights(edges: &[f32], kappa: f32, out: &mut [f32]) {
    for (out, &e) in out.iter_mut().zip(edges) {
        *out = boundary_weight(e, kappa);
    }
}

#[multiversion(targets = "simd")]
fn clamp_row(row: &mut [f32], low: f32, high: f32) {
    for x in row {
        let y = if *x > low { *x } else { low };
        *x = if y < high { y } else { high };
    }
}
