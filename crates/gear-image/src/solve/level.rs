//! One level of the hierarchy: its stencil, how it coarsens, and the operator in f64.

use rayon::prelude::*;

use super::planes::{Layout, Planes};
use super::{Coefficients, Outside};
use crate::Mask;

/// Stencil of the pixels of one colour. Horizontal links are told apart by the aggregate they stay in.
pub(super) struct Stencil {
    /// Link to the horizontal neighbour of the same 2×2 aggregate (same column of the other plane).
    pub near: Vec<f32>,
    /// Link to the horizontal neighbour of the adjacent aggregate (column − 1 or + 1).
    pub far: Vec<f32>,
    pub up: Vec<f32>,
    pub down: Vec<f32>,
    pub absorption: Vec<f32>,
    /// 1 / (absorption + Σ links); 0 where that is 0 (outside, or a floating coarse cell).
    pub inverse: Vec<f32>,
}

/// A level: the two colours' stencils.
pub(super) struct Level {
    pub layout: Layout,
    pub colours: [Stencil; 2],
}

fn positive(x: f32) -> f32 {
    if x > 0.0 { x.min(1e30) } else { 0.0 }
}

/// Whether the far neighbour of `colour` in row `y` is at column + 1 (else − 1).
#[inline]
pub(super) fn far_is_right(colour: usize, y: usize) -> bool {
    (colour + y) & 1 == 1
}

/// Links and absorption by pixel, before they are sorted into planes.
struct Plain {
    absorption: Planes<f32>,
    right: Planes<f32>,
    down: Planes<f32>,
}

impl Level {
    /// The finest level.
    pub fn assemble(mask: &Mask, coefficients: &Coefficients) -> Self {
        let (width, height) = mask.size();
        let layout = Layout::new(width, height);
        let mut plain = Plain {
            absorption: Planes::zeros(layout),
            right: Planes::zeros(layout),
            down: Planes::zeros(layout),
        };
        let right = |x, y| positive(coefficients.right.map_or(1.0, |w| w.at(x, y)));
        let down = |x, y| positive(coefficients.down.map_or(1.0, |w| w.at(x, y)));
        let open = coefficients.outside == Outside::Zero;
        for y in 0..height {
            for x in 0..width {
                if !mask.at(x, y) {
                    continue;
                }
                let own = coefficients.absorption.map_or(0.0, |a| a.at(x, y));
                let mut absorption = positive(own) + positive(coefficients.screening);
                if x + 1 < width {
                    if mask.at(x + 1, y) {
                        plain.right.set(x, y, right(x, y));
                    } else if open {
                        absorption += right(x, y);
                    }
                }
                if y + 1 < height {
                    if mask.at(x, y + 1) {
                        plain.down.set(x, y, down(x, y));
                    } else if open {
                        absorption += down(x, y);
                    }
                }
                if open && x > 0 && !mask.at(x - 1, y) {
                    absorption += right(x - 1, y);
                }
                if open && y > 0 && !mask.at(x, y - 1) {
                    absorption += down(x, y - 1);
                }
                plain.absorption.set(x, y, absorption);
            }
        }
        Self::from_plain(layout, plain)
    }

    fn from_plain(layout: Layout, plain: Plain) -> Self {
        let [red_absorption, black_absorption] = plain.absorption.colours.clone();
        let mut colours = [red_absorption, black_absorption].map(|absorption| Stencil {
            near: vec![0.0; layout.len()],
            far: vec![0.0; layout.len()],
            up: vec![0.0; layout.len()],
            down: vec![0.0; layout.len()],
            inverse: vec![0.0; layout.len()],
            absorption,
        });
        for y in 0..layout.height {
            for x in 0..layout.width {
                let (colour, k) = layout.place(x, y);
                let left = if x > 0 { plain.right.at(x - 1, y) } else { 0.0 };
                let right = plain.right.at(x, y);
                let stencil = &mut colours[colour];
                (stencil.near[k], stencil.far[k]) = if x & 1 == 0 { (right, left) } else { (left, right) };
                stencil.up[k] = if y > 0 { plain.down.at(x, y - 1) } else { 0.0 };
                stencil.down[k] = plain.down.at(x, y);
                let diagonal = f64::from(stencil.absorption[k])
                    + f64::from(left)
                    + f64::from(right)
                    + f64::from(stencil.up[k])
                    + f64::from(stencil.down[k]);
                stencil.inverse[k] = if diagonal > 1e-30 { (1.0 / diagonal) as f32 } else { 0.0 };
            }
        }
        Self { layout, colours }
    }

    /// The next level, or `None` when this one is a single cell.
    pub fn coarsen(&self) -> Option<Self> {
        let fine = self.layout;
        if fine.width <= 1 && fine.height <= 1 {
            return None;
        }
        let layout = Layout::new(fine.width.div_ceil(2), fine.height.div_ceil(2));
        let mut plain = Plain {
            absorption: Planes::zeros(layout),
            right: Planes::zeros(layout),
            down: Planes::zeros(layout),
        };
        for y in 0..layout.height {
            for x in 0..layout.width {
                let (top, bottom) = (2 * y * fine.columns + x, (2 * y + 1) * fine.columns + x);
                let [red, black] = &self.colours;
                let absorption = [top, bottom].map(|k| red.absorption[k] + black.absorption[k]);
                plain.absorption.set(x, y, absorption[0] + absorption[1]);
                // Column x of the upper row has its black pixel at the right, of the lower row its red one.
                plain.right.set(x, y, 0.5 * (black.far[top] + red.far[bottom]));
                plain.down.set(x, y, 0.5 * (red.down[bottom] + black.down[bottom]));
            }
        }
        Some(Self::from_plain(layout, plain))
    }

    /// Links of pixel (x, y) to its right and to its lower neighbour.
    pub fn links_at(&self, x: usize, y: usize) -> (f32, f32) {
        let (colour, k) = self.layout.place(x, y);
        let stencil = &self.colours[colour];
        let right = if x & 1 == 0 { stencil.near[k] } else { stencil.far[k] };
        (right, stencil.down[k])
    }

    /// `out = A u` in f64, in difference form `a u + Σ w (u − u_q)`, which is exact for constants.
    pub fn apply(&self, u: &Planes<f64>, out: &mut Planes<f64>) {
        let Layout { columns, rows, .. } = self.layout;
        let band = self.layout.band_rows();
        for (colour, plane) in out.colours.iter_mut().enumerate() {
            let stencil = &self.colours[colour];
            let (own, other) = (&u.colours[colour], &u.colours[1 - colour]);
            plane
                .par_chunks_mut(columns * band)
                .enumerate()
                .for_each(|(chunk, part)| {
                    for (row, out) in part.chunks_mut(columns).enumerate() {
                        let y = chunk * band + row;
                        let at = y * columns..(y + 1) * columns;
                        let above = y.saturating_sub(1) * columns;
                        let below = (y + 1).min(rows - 1) * columns;
                        let (own, mid) = (&own[at.clone()], &other[at.clone()]);
                        let (above, below) = (&other[above..above + columns], &other[below..below + columns]);
                        let (near, far) = (&stencil.near[at.clone()], &stencil.far[at.clone()]);
                        let (up, down) = (&stencil.up[at.clone()], &stencil.down[at.clone()]);
                        let absorption = &stencil.absorption[at];
                        for k in 0..columns {
                            let v = own[k];
                            out[k] = f64::from(absorption[k]) * v
                                + f64::from(near[k]) * (v - mid[k])
                                + f64::from(up[k]) * (v - above[k])
                                + f64::from(down[k]) * (v - below[k]);
                        }
                        if far_is_right(colour, y) {
                            for k in 0..columns - 1 {
                                out[k] += f64::from(far[k]) * (own[k] - mid[k + 1]);
                            }
                        } else {
                            for k in 1..columns {
                                out[k] += f64::from(far[k]) * (own[k] - mid[k - 1]);
                            }
                        }
                    }
                });
        }
    }

    /// Connected parts (by links) whose absorption is zero everywhere, as row-major pixel numbers.
    pub fn floating_parts(&self, mask: &Mask) -> Vec<Vec<u32>> {
        let (width, height) = mask.size();
        let mut seen = vec![false; width * height];
        let mut parts = Vec::new();
        let mut stack = Vec::new();
        for start in 0..width * height {
            if seen[start] || !mask.data()[start] {
                continue;
            }
            let mut part = Vec::new();
            let mut absorbed = false;
            seen[start] = true;
            stack.push(start);
            while let Some(p) = stack.pop() {
                part.push(p as u32);
                let (x, y) = (p % width, p / width);
                let (colour, k) = self.layout.place(x, y);
                absorbed |= self.colours[colour].absorption[k] > 0.0;
                let (right, down) = self.links_at(x, y);
                let left = if x > 0 { self.links_at(x - 1, y).0 } else { 0.0 };
                let up = if y > 0 { self.links_at(x, y - 1).1 } else { 0.0 };
                for (link, q) in [
                    (right, p + 1),
                    (down, p + width),
                    (left, p.wrapping_sub(1)),
                    (up, p.wrapping_sub(width)),
                ] {
                    if link > 0.0 && !seen[q] {
                        seen[q] = true;
                        stack.push(q);
                    }
                }
            }
            if !absorbed {
                part.sort_unstable();
                parts.push(part);
            }
        }
        parts
    }
}
