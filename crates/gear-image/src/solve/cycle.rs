//! The preconditioner: one symmetric V(1,1) cycle in f32. The [module above](super) explains what it leaves out.

use rayon::prelude::*;

use super::level::{Level, Stencil, far_is_right};
use super::planes::Planes;

/// Right-hand sides and corrections of every level, reused from cycle to cycle.
pub(super) struct Workspace {
    pub rhs: Vec<Planes<f32>>,
    pub correction: Vec<Planes<f32>>,
}

const RED: usize = 0;
const BLACK: usize = 1;

impl Workspace {
    pub fn new(levels: &[Level]) -> Self {
        let zeros = || levels.iter().map(|level| Planes::zeros(level.layout)).collect();
        Self {
            rhs: zeros(),
            correction: zeros(),
        }
    }

    /// `correction[0] ≈ A⁻¹ rhs[0]`.
    pub fn cycle(&mut self, levels: &[Level]) {
        for (l, level) in levels.iter().enumerate() {
            let (done, coarser) = self.rhs.split_at_mut(l + 1);
            let rhs = &done[l];
            let u = &mut self.correction[l];
            let inverse = &level.colours[RED].inverse;
            for ((u, f), inverse) in u.colours[RED].iter_mut().zip(&rhs.colours[RED]).zip(inverse) {
                *u = f * inverse;
            }
            half_sweep(level, BLACK, u, &rhs.colours[BLACK]);
            if let Some(coarse) = coarser.first_mut() {
                restrict_red_residual(level, u, coarse);
            }
        }
        for l in (0..levels.len().saturating_sub(1)).rev() {
            let (finer, coarser) = self.correction.split_at_mut(l + 1);
            let (level, u) = (&levels[l], &mut finer[l]);
            prolong_to_red(u, &coarser[0]);
            half_sweep(level, BLACK, u, &self.rhs[l].colours[BLACK]);
            half_sweep(level, RED, u, &self.rhs[l].colours[RED]);
        }
    }
}

/// What the other colour sends to row `y`: `out[k] = start[k] + Σ w_q u_q`.
#[inline]
fn gather_row(out: &mut [f32], stencil: &Stencil, other: &[f32], colour: usize, y: usize, rows: usize) {
    let columns = out.len();
    let at = y * columns..(y + 1) * columns;
    // The first and last rows have no link outwards, so which row stands in for the missing one is of no effect.
    let above = y.saturating_sub(1) * columns;
    let below = (y + 1).min(rows - 1) * columns;
    let mid = &other[at.clone()];
    let (above, below) = (&other[above..above + columns], &other[below..below + columns]);
    let (near, far) = (&stencil.near[at.clone()], &stencil.far[at.clone()]);
    let (up, down) = (&stencil.up[at.clone()], &stencil.down[at]);
    for k in 0..columns {
        out[k] += near[k] * mid[k] + up[k] * above[k] + down[k] * below[k];
    }
    if far_is_right(colour, y) {
        for k in 0..columns - 1 {
            out[k] += far[k] * mid[k + 1];
        }
    } else {
        for k in 1..columns {
            out[k] += far[k] * mid[k - 1];
        }
    }
}

/// Gauss–Seidel on one colour: `u = (f + Σ w_q u_q) / d`.
fn half_sweep(level: &Level, colour: usize, u: &mut Planes<f32>, rhs: &[f32]) {
    let layout = level.layout;
    let [red, black] = &mut u.colours;
    let (own, other) = if colour == RED { (red, &*black) } else { (black, &*red) };
    let stencil = &level.colours[colour];
    let band = layout.band_rows();
    let work = |(chunk, part): (usize, &mut [f32])| {
        for (row, out) in part.chunks_mut(layout.columns).enumerate() {
            let y = chunk * band + row;
            let at = y * layout.columns..(y + 1) * layout.columns;
            out.copy_from_slice(&rhs[at.clone()]);
            gather_row(out, stencil, other, colour, y, layout.rows);
            for (u, inverse) in out.iter_mut().zip(&stencil.inverse[at]) {
                *u *= inverse;
            }
        }
    };
    let size = layout.columns * band;
    if layout.rows > band {
        own.par_chunks_mut(size).enumerate().for_each(work);
    } else {
        own.chunks_mut(size).enumerate().for_each(work);
    }
}

/// Sums the red residual, which is `Σ w_q u_q`, over aggregates. The black one is zero.
fn restrict_red_residual(level: &Level, u: &Planes<f32>, coarse: &mut Planes<f32>) {
    let layout = level.layout;
    let mut residual = vec![0.0f32; 2 * layout.columns];
    for y in 0..coarse.layout.height {
        residual.fill(0.0);
        let (top, bottom) = residual.split_at_mut(layout.columns);
        gather_row(top, &level.colours[RED], &u.colours[BLACK], RED, 2 * y, layout.rows);
        gather_row(
            bottom,
            &level.colours[RED],
            &u.colours[BLACK],
            RED,
            2 * y + 1,
            layout.rows,
        );
        for x in 0..coarse.layout.width {
            coarse.set(x, y, top[x] + bottom[x]);
        }
    }
}

fn prolong_to_red(u: &mut Planes<f32>, coarse: &Planes<f32>) {
    let columns = u.layout.columns;
    for (y, row) in u.colours[RED].chunks_mut(columns).enumerate() {
        for (x, u) in row.iter_mut().enumerate() {
            *u += coarse.at(x, y / 2);
        }
    }
}
