//! Sparse symmetric systems on masked grids.
//!
//! Every elliptic problem of the project is one quadratic form on the 4-neighbour grid of a mask,
//!
//! ```text
//! E(u) = Σ_links w_pq (u_p − u_q)² + Σ_p a_p u_p² − 2 Σ_p f_p u_p,      w ≥ 0, a ≥ 0
//! ```
//!
//! whose minimiser solves `A u = f` with `A` symmetric positive (semi)definite and an M-matrix: `f ≥ 0` gives
//! `u ≥ 0`, and a larger `a` gives a smaller `u`. Inflation is `w = 1`, `a = ` ink, zero Dirichlet values
//! outside the mask; reintegration of a gradient is `w = 1` with a small or screening `a`.
//!
//! # Method
//!
//! Conjugate gradients in f64, preconditioned by one symmetric V(1,1) cycle of aggregation multigrid in f32.
//!
//! *Aggregation.* 2×2 cells become one unknown; the coarse absorption is the sum of the fine ones, the coarse
//! link half the sum of the fine links it replaces (plain Galerkin aggregation, without the half, makes the
//! coarse operator twice too stiff for smooth errors); transfers are piecewise constant. Nothing looks at the
//! shape of the mask, so every level is again an M-matrix for *any* mask, link weight and absorption. A
//! rediscretised hierarchy with bilinear transfers diverges on irregular masks.
//!
//! *Red-black storage.* Pixels of even and of odd `x + y` are kept in two planes, and the pixel `(x, y)` is at
//! column `⌊x/2⌋` of its plane. Then the neighbours of a red pixel are black pixels of columns `k`, `k ± 1`, a
//! half sweep reads one plane and writes the other (so it runs in parallel, in place, in any order, with the same
//! bits), its loops are contiguous, and the four pixels of an aggregate all have column `k = X`.
//!
//! *What a cycle may leave out.* It starts from zero, so after the red half sweep `u = f/d` the red residual is
//! just what black neighbours send; after the black half sweep the black residual is zero; and the first half
//! sweep on the way up overwrites every black value. So only red residuals are restricted and only red
//! values receive the coarse correction.
//!
//! *What must stay true.* The way up mirrors the way down (red, black | black, red): the preconditioner is then
//! symmetric and CG is allowed to use it. The scalars of CG are fixed-shape f64 sums ([`reduce`]), so
//! that results have the same bits for any number of threads.

mod cycle;
mod level;
mod pcg;
mod planes;
pub mod reduce;
#[cfg(test)]
mod tests;

pub use pcg::{Solution, SolveOptions};

use crate::{Field, Mask};
use level::Level;
use planes::{Layout, Planes};

/// What is known outside the mask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outside {
    /// Nothing: links to the outside do not exist (natural, Neumann).
    #[default]
    Free,
    /// The value is zero there (Dirichlet). The picture's frame stays free: what is cropped is open, not closed.
    Zero,
}

/// The coefficients of a system; see the [module](self).
#[derive(Clone, Copy, Debug)]
pub struct Coefficients<'a> {
    /// Absorption `a` of every pixel, in 1/px²; `None` is 0. Negative or NaN counts as 0.
    pub absorption: Option<&'a Field>,
    /// Added to `absorption` everywhere.
    pub screening: f32,
    /// Link weights to the right neighbour, at the left pixel; `None` is 1. Negative or NaN counts as 0.
    pub right: Option<&'a Field>,
    /// Link weights to the lower neighbour, at the upper pixel; `None` is 1.
    pub down: Option<&'a Field>,
    /// What is known outside the mask.
    pub outside: Outside,
}

impl Default for Coefficients<'_> {
    fn default() -> Self {
        Self {
            absorption: None,
            screening: 0.0,
            right: None,
            down: None,
            outside: Outside::Free,
        }
    }
}

/// An assembled operator with its multigrid hierarchy: built once, solved for many right-hand sides.
pub struct GridSystem {
    width: usize,
    height: usize,
    mask: Mask,
    /// Fine level first. Empty for an empty raster.
    levels: Vec<Level>,
    /// Pixels of each connected part without absorption, on which `A` is singular.
    floating: Vec<Vec<u32>>,
}

impl GridSystem {
    /// Assembles the operator on `mask`. Rasters in `coefficients` must have the mask's size (else panics).
    pub fn new(mask: &Mask, coefficients: &Coefficients) -> Self {
        let (width, height) = mask.size();
        for raster in [coefficients.absorption, coefficients.right, coefficients.down]
            .into_iter()
            .flatten()
        {
            assert_eq!(raster.size(), mask.size(), "coefficients must have the mask's size");
        }
        let mut levels = Vec::new();
        if width * height > 0 {
            levels.push(Level::assemble(mask, coefficients));
            while let Some(coarse) = levels.last().and_then(Level::coarsen) {
                levels.push(coarse);
            }
        }
        let floating = levels.first().map_or_else(Vec::new, |fine| fine.floating_parts(mask));
        Self {
            width,
            height,
            mask: mask.clone(),
            levels,
            floating,
        }
    }

    /// The mask the system lives on.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Solves `A u = rhs` (row-major, outside values ignored), from `start` if given, else from zero.
    ///
    /// On a connected part without any absorption the mean of `rhs` is removed and the mean of `u` is 0.
    /// A right-hand side with a NaN or infinity gives back the start, not converged.
    pub fn solve(&self, rhs: &[f64], start: Option<&[f64]>, options: SolveOptions) -> Solution {
        assert_eq!(
            rhs.len(),
            self.width * self.height,
            "right-hand side must fill the raster"
        );
        pcg::solve(self, rhs, start, options)
    }

    /// `A u`, row-major; 0 outside the mask.
    pub fn apply(&self, u: &[f64]) -> Vec<f64> {
        let Some(fine) = self.levels.first() else {
            return Vec::new();
        };
        let u = Planes::gather(fine.layout, u, &self.mask);
        let mut out = Planes::zeros(fine.layout);
        fine.apply(&u, &mut out);
        out.scatter(self.width, self.height)
    }

    /// The right-hand side `−div` of a gradient given on links: `right.at(x, y)` belongs to the link from
    /// (x, y) to (x + 1, y), `down.at(x, y)` to the one to (x, y + 1). Its solution minimises
    /// `Σ w (u_q − u_p − g_pq)²` plus absorption. Links that leave the mask do not count.
    pub fn divergence_of_links(&self, right: &Field, down: &Field) -> Vec<f64> {
        let mut out = vec![0.0; self.width * self.height];
        let mut add = |p: usize, q: usize, w: f32, g: f32| {
            let flux = f64::from(w) * f64::from(g);
            out[q] += flux;
            out[p] -= flux;
        };
        let Some(fine) = self.levels.first() else { return out };
        for y in 0..self.height {
            for x in 0..self.width {
                let p = y * self.width + x;
                let (to_right, to_down) = fine.links_at(x, y);
                if to_right > 0.0 {
                    add(p, p + 1, to_right, right.at(x, y));
                }
                if to_down > 0.0 {
                    add(p, p + self.width, to_down, down.at(x, y));
                }
            }
        }
        out
    }

    /// [`Self::divergence_of_links`] of a gradient given at pixels, averaged to the links between them.
    pub fn divergence_of_pixels(&self, gx: &Field, gy: &Field) -> Vec<f64> {
        let right = Field::from_fn(self.width, self.height, |x, y| {
            0.5 * (gx.at(x, y) + gx.at((x + 1).min(self.width - 1), y))
        });
        let down = Field::from_fn(self.width, self.height, |x, y| {
            0.5 * (gy.at(x, y) + gy.at(x, (y + 1).min(self.height - 1)))
        });
        self.divergence_of_links(&right, &down)
    }

    fn layout(&self) -> Option<Layout> {
        self.levels.first().map(|level| level.layout)
    }
}
