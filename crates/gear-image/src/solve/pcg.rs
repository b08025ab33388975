//! Conjugate gradients on red-black planes, in f64.

use rayon::prelude::*;

use super::cycle::Workspace;
use super::planes::Planes;
use super::{GridSystem, reduce};
use crate::Field;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions {
    /// Relative residual `‖f − A u‖ / ‖f‖` at which the solution is good enough.
    pub tolerance: f64,
    /// Iterations at most.
    pub max_iterations: usize,
}

impl Default for SolveOptions {
    /// 1e-5 (an inflated height is then within .01 px at 512²), 100 iterations.
    fn default() -> Self {
        Self {
            tolerance: 1e-5,
            max_iterations: 100,
        }
    }
}

/// What [`GridSystem::solve`] found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// `u`, row-major, 0 outside the mask.
    pub values: Vec<f64>,
    /// Iterations done.
    pub iterations: usize,
    /// Relative residual before each iteration and after the last.
    pub residuals: Vec<f64>,
    /// Whether the tolerance was reached.
    pub converged: bool,
}

impl Solution {
    /// The values as a raster.
    pub fn to_field(&self, width: usize, height: usize) -> Field {
        Field::from_vec(width, height, self.values.iter().map(|&u| u as f32).collect())
    }
}

fn dot(a: &Planes<f64>, b: &Planes<f64>) -> f64 {
    reduce::dot(&a.colours[0], &b.colours[0]) + reduce::dot(&a.colours[1], &b.colours[1])
}

/// `y = x·alpha + y·beta`.
fn combine(alpha: f64, x: &Planes<f64>, beta: f64, y: &mut Planes<f64>) {
    for (y, x) in y.colours.iter_mut().zip(&x.colours) {
        y.par_chunks_mut(16_384).zip(x.par_chunks(16_384)).for_each(|(y, x)| {
            for (y, x) in y.iter_mut().zip(x) {
                *y = alpha * x + beta * *y;
            }
        });
    }
}

/// Removes the mean on every floating part, where the operator does not see constants.
fn remove_floating_means(system: &GridSystem, values: &mut [f64]) {
    for part in &system.floating {
        let members: Vec<f64> = part.iter().map(|&p| values[p as usize]).collect();
        let mean = reduce::sum(&members) / members.len() as f64;
        for &p in part {
            values[p as usize] -= mean;
        }
    }
}

/// One cycle on `r / scale`: f32 has the digits but not the range of f64.
fn precondition(system: &GridSystem, work: &mut Workspace, r: &Planes<f64>, scale: f64, z: &mut Planes<f64>) {
    let inverse = 1.0 / scale;
    for (out, r) in work.rhs[0].colours.iter_mut().zip(&r.colours) {
        for (out, r) in out.iter_mut().zip(r) {
            *out = (r * inverse) as f32;
        }
    }
    work.cycle(&system.levels);
    for (z, u) in z.colours.iter_mut().zip(&work.correction[0].colours) {
        for (z, u) in z.iter_mut().zip(u) {
            *z = f64::from(*u) * scale;
        }
    }
}

pub(super) fn solve(system: &GridSystem, rhs: &[f64], start: Option<&[f64]>, options: SolveOptions) -> Solution {
    let (width, height) = (system.width, system.height);
    let Some(layout) = system.layout() else {
        return Solution {
            values: Vec::new(),
            iterations: 0,
            residuals: vec![0.0],
            converged: true,
        };
    };
    let fine = &system.levels[0];
    let mut rhs = rhs.to_vec();
    remove_floating_means(system, &mut rhs);
    let f = Planes::gather(layout, &rhs, &system.mask);
    let norm = dot(&f, &f).sqrt();
    let mut u = match start {
        Some(start) => Planes::gather(layout, start, &system.mask),
        None => Planes::zeros(layout),
    };
    let mut residuals = Vec::new();
    let mut iterations = 0;
    if norm.is_finite() && norm > 0.0 {
        let mut r = f;
        let mut q = Planes::zeros(layout);
        if start.is_some() {
            fine.apply(&u, &mut q);
            combine(-1.0, &q, 1.0, &mut r);
        }
        let mut work = Workspace::new(&system.levels);
        let mut z = Planes::zeros(layout);
        let mut p = Planes::zeros(layout);
        let mut rz = 1.0;
        loop {
            let size = dot(&r, &r).sqrt();
            residuals.push(size / norm);
            let done = size <= options.tolerance * norm || !size.is_finite();
            if done || iterations >= options.max_iterations {
                break;
            }
            precondition(system, &mut work, &r, size, &mut z);
            let next = dot(&r, &z);
            // Positive for any positive definite operator; anything else is rounding at the end of the road.
            if !(next > 0.0 && next.is_finite()) {
                break;
            }
            combine(1.0, &z, if iterations == 0 { 0.0 } else { next / rz }, &mut p);
            rz = next;
            fine.apply(&p, &mut q);
            let curvature = dot(&p, &q);
            if !(curvature > 0.0 && curvature.is_finite()) {
                break;
            }
            let step = rz / curvature;
            combine(step, &p, 1.0, &mut u);
            combine(-step, &q, 1.0, &mut r);
            iterations += 1;
        }
    } else {
        if norm == 0.0 {
            u = Planes::zeros(layout);
        }
        residuals.push(if norm == 0.0 { 0.0 } else { f64::NAN });
    }
    let mut values = u.scatter(width, height);
    remove_floating_means(system, &mut values);
    let converged = residuals.last().is_some_and(|&residual| residual <= options.tolerance);
    Solution {
        values,
        iterations,
        residuals,
        converged,
    }
}
