//! How the data term bends by the pixels of a picture: its Gauss–Newton model.
//!
//! |r| counts as r²/max(|r|, ε). With d = x − y, 1 − S is about (K∗d)²/b₁ + (K∗d² − (K∗d)²)/b₂, where b₁ and b₂ are the
//! denominators of S. A change δ of the picture is therefore answered by H δ = p·δ + K∗(q·(K∗δ)) with
//! p = w/max(|r|, ε) + 2 K∗(w/b₂) and q = 2 w (1/b₁ − 1/b₂), each term by its share in the loss.

use rayon::prelude::*;

use super::loss::Target;
use super::ssim::{self, Compared, Scratch, Window, pitch};
use crate::Rendering;
use crate::render::PixelGradients;

/// H of one target.
pub(super) struct Curvature {
    rect: [usize; 4],
    columns: usize,
    window: Window,
    channels: [Bend; 3],
}

/// H of one channel, row by row at their pitch.
struct Bend {
    /// p: what a pixel asks alone.
    alone: Vec<f32>,
    /// q: what its surroundings ask; empty without structural similarity.
    around: Vec<f32>,
}

impl Target {
    /// The gradient of the data term by the pixels, and its curvature. `corner`: ε.
    pub fn model(&self, rendering: &Rendering, corner: f32, scratch: &mut Scratch) -> (Vec<[f32; 3]>, Curvature) {
        let compared = self.compared(rendering);
        let (absolute, similar) = ((1.0 - self.ssim) / 3.0, self.ssim / 3.0);
        let mut gradient = PixelGradients::default();
        let smooth = |y: usize, row: &mut [[f32; 3]]| {
            for c in 0..3 {
                let differences = difference_row(&compared, c, y);
                for ((out, d), w) in row
                    .iter_mut()
                    .zip(differences)
                    .zip(compared.plane_row(compared.weights, y))
                {
                    out[c] = absolute * w * d / d.abs().max(corner);
                }
            }
        };
        self.write_gradient(&compared, similar, scratch, &mut gradient, smooth);
        let channels = [0, 1, 2].map(|c| Bend::new(&compared, c, corner, absolute, similar));
        let curvature = Curvature {
            rect: compared.rect,
            columns: compared.columns,
            window: compared.window,
            channels,
        };
        (gradient.rgb, curvature)
    }
}

/// x − y in one channel of row `y` of the rectangle.
fn difference_row<'a>(compared: &'a Compared, channel: usize, y: usize) -> impl Iterator<Item = f32> + 'a {
    let target = compared.plane_row(&compared.fixed[channel].y, y);
    compared.row(y).iter().zip(target).map(move |(x, y)| x[channel] - y)
}

impl Bend {
    fn new(compared: &Compared, channel: usize, corner: f32, absolute: f32, similar: f32) -> Self {
        let [_, _, width, height] = compared.rect;
        let mut alone = vec![0.0; pitch(width) * height];
        let mut around = Vec::new();
        if similar > 0.0 {
            let [b1, b2] = ssim::denominators(compared, channel);
            let weighed = |b: &f32, w: &f32| 2.0 * similar * w / b;
            alone = b2.iter().zip(compared.weights).map(|(b, w)| weighed(b, w)).collect();
            around = b1.iter().zip(compared.weights).map(|(b, w)| weighed(b, w)).collect();
            around.iter_mut().zip(&alone).for_each(|(q, p)| *q -= p);
            [alone, _] = ssim::moments(&alone, width, &compared.window);
        }
        for y in 0..height {
            let row = &mut alone[y * pitch(width)..][..width];
            let weights = compared.plane_row(compared.weights, y);
            for ((p, d), w) in row.iter_mut().zip(difference_row(compared, channel, y)).zip(weights) {
                *p += absolute * w / d.abs().max(corner);
            }
        }
        Self { alone, around }
    }
}

impl Curvature {
    /// H δ, for pictures of the target's camera.
    pub fn apply(&self, delta: &[[f32; 3]]) -> Vec<[f32; 3]> {
        self.each_channel(delta, |bend, width, plane| {
            let mut out: Vec<f32> = bend.alone.iter().zip(&plane).map(|(p, d)| p * d).collect();
            if !bend.around.is_empty() {
                let [mut blurred, _] = ssim::moments(&plane, width, &self.window);
                blurred.iter_mut().zip(&bend.around).for_each(|(x, q)| *x *= q);
                let [back, _] = ssim::moments(&blurred, width, &self.window);
                out.iter_mut().zip(&back).for_each(|(out, x)| *out += x);
            }
            out
        })
    }

    /// p · δ: H without what ties pixels together. It is all positive, for a preconditioner.
    pub fn apply_alone(&self, delta: &[[f32; 3]]) -> Vec<[f32; 3]> {
        self.each_channel(delta, |bend, _, plane| {
            bend.alone.iter().zip(&plane).map(|(p, d)| p * d).collect()
        })
    }

    /// Hands the rectangle of each channel of a picture to `change`, and makes a picture of what comes back.
    fn each_channel(
        &self,
        picture: &[[f32; 3]],
        change: impl Fn(&Bend, usize, Vec<f32>) -> Vec<f32> + Sync,
    ) -> Vec<[f32; 3]> {
        let [left, top, width, height] = self.rect;
        let planes: Vec<Vec<f32>> = (0..3)
            .into_par_iter()
            .map(|c| {
                let mut plane = vec![0.0; pitch(width) * height];
                for (y, out) in plane.chunks_exact_mut(pitch(width)).enumerate() {
                    let row = &picture[(top + y) * self.columns + left..][..width];
                    out.iter_mut().zip(row).for_each(|(out, pixel)| *out = pixel[c]);
                }
                change(&self.channels[c], width, plane)
            })
            .collect();
        let mut out = vec![[0.0; 3]; picture.len()];
        for y in 0..height {
            let row = &mut out[(top + y) * self.columns + left..][..width];
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = [0, 1, 2].map(|c| planes[c][y * pitch(width) + x]);
            }
        }
        out
    }
}
