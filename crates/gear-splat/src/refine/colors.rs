//! The colours of fixed shapes, by conjugate gradients.
//!
//! With fixed shapes a picture is linear in the colours: R = W c + T b, with the blend weights W. W p is the picture of the
//! scene in the colours p, Wᵀ g is the rasteriser's gradient by colours for the gradient g by pixels, so that neither is
//! ever written down. What is minimised is the loss that Adam's steps minimise, with its anchor and its limits.
//!
//! It is not quadratic: |r| has a corner, and structural similarity is a quotient. So the problem is solved in rounds. Each
//! takes the loss's true gradient where it is, and as curvature the symmetric matrix Jᵀ H J + μ, with J = Y₀ W and H the
//! Gauss–Newton model of the loss by pixels:
//!
//! * |r| counts as r²/max(|r|, ε), as in iteratively reweighted least squares; ε falls from round to round;
//! * 1 − S is about [(K∗d)²]/b₁ + [K∗d² − (K∗d)²]/b₂ with d = x − y and the denominators b of S held: both are squares.
//!
//! A round takes [`ROUND`] steps of conjugate gradients on it, one channel as good as alone, with the matrix's row sums as
//! preconditioner (W has no negative entries, so they are above the diagonal and show where a Gaussian is seen much or
//! little). Colours at a limit that the gradient pushes against stay there. The step is then halved until the
//! true loss has fallen; if it does not fall at all, the minimum is reached.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::anchored::CHUNK;
use super::curvature::Curvature;
use super::{Checkpoints, RefineError, Run, Status, Step};
use crate::device::{DeviceError, Frame};
use crate::render::{PixelGradients, Wanted};
use crate::{Rendering, Scene};

/// Steps of conjugate gradients on one model of the loss.
const ROUND: usize = 10;
/// ε of the first round; colours are 0 to 1.
pub(super) const CORNER: f32 = 0.02;
/// ε of late rounds.
const SHARPEST: f32 = 5e-4;
/// A step is halved so many times at most.
const HALVINGS: usize = 8;
/// Residuals smaller than this share of the first one end a round.
const ENOUGH: f64 = 1e-4;

/// Coordinates of all colours: three a Gaussian.
type Colors = Vec<f32>;

impl Run<'_> {
    /// Moves the colours for up to `iterations` steps of conjugate gradients.
    pub(super) fn solve_colors(
        &mut self,
        iterations: usize,
        checkpoints: &mut dyn Checkpoints,
        observe: &mut dyn FnMut(Step) -> ControlFlow<()>,
    ) -> Result<(), RefineError> {
        self.keep_frames()?;
        let mut probe = Probe::new(&self.anchored.scene);
        probe.prepare(&mut self.frames)?;
        while self.step < iterations {
            let system = System::new(self, &mut probe)?;
            let mut direction = vec![0.0; system.slope.len()];
            let mut descent = Descent::new(&system);
            for _ in 0..ROUND.min(iterations - self.step) {
                let goes_on = descent.step(&system, &mut probe, &mut self.frames, &mut direction)?;
                (self.step, self.done) = (self.step + 1, self.done + 1);
                self.tell(observe)?;
                if !goes_on {
                    break;
                }
            }
            let before = self.curve.last().map_or(f64::INFINITY, |p| p.loss);
            let fell = self.search(&direction, before)?;
            let was_sharp = self.corner <= SHARPEST;
            self.corner = (0.5 * self.corner).max(SHARPEST);
            if was_sharp && fell < self.options.tolerance * before.abs() {
                self.status = Status::Converged;
                break;
            }
            checkpoints.keep(&|| self.state());
        }
        Ok(())
    }

    /// Goes along `direction`, or half of it and so on, to where the loss is below `before`; returns by how much it fell.
    fn search(&mut self, direction: &[f32], before: f64) -> Result<f64, RefineError> {
        let start = self.anchored.scene.sh_dc.clone();
        let mut share = 1.0;
        for _ in 0..=HALVINGS {
            let colors = self.anchored.scene.sh_dc.as_flattened_mut();
            for ((x, start), d) in colors.iter_mut().zip(start.as_flattened()).zip(direction) {
                *x = start + share * d;
            }
            self.anchored.restrain_colors();
            let point = self.look(self.done)?;
            if point.loss < before {
                self.note(point);
                return Ok(before - point.loss);
            }
            share *= 0.5;
        }
        self.anchored.scene.sh_dc = start;
        Ok(0.0)
    }
}

/// The scene in any colours, also negative ones, seen by the kept frames.
///
/// The rasteriser clamps colours at zero. So a direction is drawn around grey, short enough to stay between black and
/// white, and what grey alone gives is subtracted.
struct Probe {
    scene: Scene,
    /// By view.
    grey: Vec<Rendering>,
    /// J 1: what the pixels of each view get from all Gaussians together.
    whole: Vec<Vec<[f32; 3]>>,
}

impl Probe {
    fn new(scene: &Scene) -> Self {
        let mut scene = scene.clone();
        scene.sh_degree = 0;
        scene.sh_rest.clear();
        scene.sh_dc.fill([0.0; 3]);
        Self {
            scene,
            grey: Vec::new(),
            whole: Vec::new(),
        }
    }

    /// Draws what does not change.
    fn prepare(&mut self, frames: &mut [Frame]) -> Result<(), DeviceError> {
        let ones = vec![1.0; 3 * self.scene.len()];
        for (view, frame) in frames.iter_mut().enumerate() {
            self.scene.sh_dc.fill([0.0; 3]);
            frame.recolor(&self.scene);
            self.grey.push(frame.draw(&self.scene)?);
            let whole = self.draw(frame, view, &ones, 1.0)?;
            self.whole.push(whole);
        }
        Ok(())
    }

    /// J p, as the difference of a picture in the colours `share` · p to grey, times `share`.
    fn draw(&mut self, frame: &mut Frame, view: usize, p: &[f32], share: f32) -> Result<Vec<[f32; 3]>, DeviceError> {
        for (color, p) in self.scene.sh_dc.as_flattened_mut().iter_mut().zip(p) {
            *color = share * p;
        }
        frame.recolor(&self.scene);
        let picture = frame.draw(&self.scene)?;
        let grey = pixels(&self.grey[view]);
        let difference = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| (a[c] - b[c]) / share);
        Ok(pixels(&picture).par_iter().zip(grey).map(difference).collect())
    }

    /// Jᵀ g, added to `out`.
    fn add_backward(
        &mut self,
        frame: &mut Frame,
        view: usize,
        gradient: Vec<[f32; 3]>,
        factor: f32,
        out: &mut [f32],
    ) -> Result<(), DeviceError> {
        self.scene.sh_dc.fill([0.0; 3]);
        frame.recolor(&self.scene);
        let gradient = PixelGradients {
            rgb: gradient,
            ..PixelGradients::default()
        };
        let by = frame.backward(&self.scene, &self.grey[view], &gradient, Wanted::COLORS)?;
        let parts = out.par_chunks_mut(CHUNK).zip(by.sh_dc.as_flattened().par_chunks(CHUNK));
        parts.for_each(|(out, by)| out.iter_mut().zip(by).for_each(|(out, by)| *out += factor * by));
        Ok(())
    }
}

fn pixels(picture: &Rendering) -> &[[f32; 3]] {
    picture.rgb.as_ref().expect("refinement draws colour").data()
}

/// One round's model of the loss: slope · d + ½ d·A d.
struct System {
    /// The gradient of the loss; zero where a colour is held.
    slope: Colors,
    /// Row sums of A.
    sums: Colors,
    /// Colours that rest against a limit.
    held: Vec<bool>,
    /// Curvature by the pixels of each view.
    curvatures: Vec<Curvature>,
    shares: Vec<f32>,
    /// Curvature of the anchor by coordinate.
    mu: Colors,
}

impl System {
    fn new(run: &mut Run, probe: &mut Probe) -> Result<Self, RefineError> {
        let (mu, mut slope) = run.anchored.color_anchor();
        let mut sums = mu.clone();
        let (mut curvatures, mut shares) = (Vec::new(), Vec::new());
        for (view, (target, frame)) in run.targets.iter().zip(&mut run.frames).enumerate() {
            let share = target.share as f32;
            frame.recolor(&run.anchored.scene);
            let picture = frame.draw(&run.anchored.scene)?;
            let (gradient, curvature) = target.model(&picture, run.corner, &mut run.scratch);
            probe.add_backward(frame, view, gradient, share, &mut slope)?;
            let whole = curvature.apply_alone(&probe.whole[view]);
            probe.add_backward(frame, view, whole, share, &mut sums)?;
            curvatures.push(curvature);
            shares.push(share);
        }
        let held = run.anchored.held_colors(&slope);
        hold(&held, &mut slope);
        Ok(Self {
            slope,
            sums,
            held,
            curvatures,
            shares,
            mu,
        })
    }

    /// A p.
    fn apply(&self, probe: &mut Probe, frames: &mut [Frame], p: &[f32]) -> Result<Colors, DeviceError> {
        let mut out: Colors = p.iter().zip(&self.mu).map(|(p, mu)| mu * p).collect();
        let most = p.par_iter().map(|p| p.abs()).reduce(|| 0.0, f32::max);
        if most > 0.0 {
            let share = 1.0 / most;
            for (view, frame) in frames.iter_mut().enumerate() {
                let seen = probe.draw(frame, view, p, share)?;
                let bent = self.curvatures[view].apply(&seen);
                probe.add_backward(frame, view, bent, self.shares[view], &mut out)?;
            }
        }
        hold(&self.held, &mut out);
        Ok(out)
    }
}

fn hold(held: &[bool], x: &mut [f32]) {
    x.iter_mut()
        .zip(held)
        .filter(|(_, held)| **held)
        .for_each(|(x, _)| *x = 0.0);
}

/// Preconditioned conjugate gradients, the three channels each with numbers of its own.
struct Descent {
    residual: Colors,
    towards: Colors,
    energy: [f64; 3],
    first: [f64; 3],
}

impl Descent {
    fn new(system: &System) -> Self {
        let residual: Colors = system.slope.iter().map(|g| -g).collect();
        let towards = precondition(system, &residual);
        let energy = dot(&residual, &towards);
        Self {
            residual,
            towards,
            energy,
            first: energy,
        }
    }

    /// One step on `x`; false when there is nothing left to do.
    fn step(
        &mut self,
        system: &System,
        probe: &mut Probe,
        frames: &mut [Frame],
        x: &mut [f32],
    ) -> Result<bool, DeviceError> {
        let bent = system.apply(probe, frames, &self.towards)?;
        let curvature = dot(&self.towards, &bent);
        let alpha: [f64; 3] = std::array::from_fn(|c| ratio(self.energy[c], curvature[c]));
        for i in 0..x.len() {
            let alpha = alpha[i % 3] as f32;
            x[i] += alpha * self.towards[i];
            self.residual[i] -= alpha * bent[i];
        }
        let next = precondition(system, &self.residual);
        let energy = dot(&self.residual, &next);
        let beta: [f64; 3] = std::array::from_fn(|c| ratio(energy[c], self.energy[c]));
        for i in 0..x.len() {
            self.towards[i] = next[i] + beta[i % 3] as f32 * self.towards[i];
        }
        self.energy = energy;
        Ok((0..3).any(|c| energy[c] > ENOUGH * ENOUGH * self.first[c]))
    }
}

/// a / b, and 0 where b is not above it.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 && (a / b).is_finite() { a / b } else { 0.0 }
}

fn precondition(system: &System, residual: &[f32]) -> Colors {
    // What no view sees and no anchor holds stays.
    let scaled = |(r, sum): (&f32, &f32)| if *sum > 0.0 { r / sum } else { 0.0 };
    residual.iter().zip(&system.sums).map(scaled).collect()
}

/// Scalar products by channel, in chunks of a fixed size.
fn dot(a: &[f32], b: &[f32]) -> [f64; 3] {
    let parts: Vec<[f64; 3]> = a
        .par_chunks(3 * CHUNK)
        .zip(b.par_chunks(3 * CHUNK))
        .map(|(a, b)| {
            let mut sums = [0.0; 3];
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                sums[i % 3] += f64::from(*a) * f64::from(*b);
            }
            sums
        })
        .collect();
    parts
        .iter()
        .fold([0.0; 3], |total, part| std::array::from_fn(|c| total[c] + part[c]))
}
