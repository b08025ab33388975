//! Anchored refinement of a scene against target views.
//!
//! Minimises, over the attributes of all Gaussians,
//!
//! ```text
//! Σ_views Σ_pixels W [(1 − λ_s)|R − T|₁/3 + λ_s (1 − SSIM(R, T))] / N  +  λ Σ_a w_a mean_i ‖x_a,i − x⁰_a,i‖²
//! ```
//!
//! W is the trust that a target gives each pixel, N the largest ΣW of any view, x⁰ the scene that is refined. The view from
//! the canonical camera, whose target is the painting itself, counts as much as all others together. The data
//! term is followed by Adam, one or a few views a step; the anchor is taken implicitly, in the metric of Adam's step
//! ([`prox`]), so that no anchor weight makes it unstable and the fixed point is the true one. First only colours
//! move, on projections that are made once; then everything does. The loss on all views is looked at every few
//! steps, and the best scene so far is what comes back.

mod anchored;
mod loss;
pub mod prox;
mod ssim;

use std::ops::ControlFlow;

use crate::device::{Device, DeviceError, Frame};
use crate::render::Wanted;
use crate::{Outputs, RenderOptions, Scene, SceneError, Views};
use anchored::Anchored;
use loss::Target;

pub use anchored::Rates;

/// How to refine.
#[derive(Clone, Debug, PartialEq)]
pub struct RefineOptions {
    /// Steps in which only colours move.
    pub color_iterations: usize,
    /// Steps in which everything moves.
    pub iterations: usize,
    /// Views looked at in each step.
    pub views_per_step: usize,
    /// λ_s: share of structural similarity in the data term, 0 to 1.
    pub ssim: f64,
    /// λ: the anchor's weight, 0 or more.
    pub anchor: f64,
    /// w_a: the anchor's weight for each attribute.
    pub anchor_weights: Rates,
    /// Adam's step for each attribute. Each decays by ten over a run.
    ///
    /// Centres, here and in `anchor_weights`, are measured in the scene's typical surfel (the median of the larger
    /// standard deviations), so that the same scene at twice the resolution is the same problem.
    pub rates: Rates,
    /// Steps between looks at the loss on all views.
    pub check_every: usize,
    /// A phase ends when the loss fell by less than this share since the last look.
    pub tolerance: f64,
    /// How views are rendered.
    pub render: RenderOptions,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            color_iterations: 30,
            iterations: 270,
            views_per_step: 1,
            ssim: 0.2,
            anchor: 1.0,
            anchor_weights: Rates {
                center: 0.05,
                rotation: 1.0,
                scale: 0.05,
                opacity: 0.05,
                color: 0.002,
            },
            rates: Rates {
                center: 0.02,
                rotation: 2e-3,
                scale: 0.04,
                opacity: 0.05,
                color: 0.1,
            },
            check_every: 25,
            tolerance: 1e-4,
            render: RenderOptions::default(),
        }
    }
}

/// One look at all views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Steps done.
    pub iteration: usize,
    /// Data term and anchor.
    pub loss: f64,
    /// The data term.
    pub data: f64,
    /// The anchor term.
    pub anchor: f64,
}

/// Why refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The loss no longer fell.
    Converged,
    /// All steps were done.
    Finished,
    /// The loss was not a number; the best scene before that is returned.
    NotFinite,
    /// No view has a pixel with a weight; the scene is returned as it was.
    NothingToFit,
}

/// What refinement gives.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The best scene.
    pub scene: Scene,
    /// The loss over time; the first point is the scene as it came.
    pub curve: Vec<Point>,
    /// Steps after which the best scene was found.
    pub best_iteration: usize,
    /// Why it ended.
    pub status: Status,
    /// How often a Gaussian was left out of a step because its gradient was not finite.
    pub skipped: usize,
    /// How close each target with a weight was, and is.
    pub fidelity: Vec<Fidelity>,
}

/// Peak signal-to-noise ratio against one target, over the pixels with at least half of its largest weight, dB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fidelity {
    /// Index of the view among the targets.
    pub view: usize,
    /// Before refinement.
    pub before: f64,
    /// After it.
    pub after: f64,
}

/// Why refinement did not start.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RefineError {
    /// The scene is ragged.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A target does not fit its camera.
    #[error("view `{view}`: {problem}")]
    View {
        /// Name of the view.
        view: String,
        /// What was found and what was expected.
        problem: String,
    },
    /// A GPU is required and did not do it.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The observer asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Steps done.
    pub iteration: usize,
    /// Steps there may be.
    pub total: usize,
    /// The last loss that was looked at.
    pub loss: f64,
}

/// [`refine_on`] the CPU.
pub fn refine(
    scene: &Scene,
    targets: &Views,
    options: &RefineOptions,
    observe: &mut dyn FnMut(Step) -> ControlFlow<()>,
) -> Result<Refined, RefineError> {
    refine_on(&Device::cpu(), scene, targets, options, observe)
}

/// Refines `scene` against `targets`, rasterising on `device`. `observe` is called after every step and may break off.
pub fn refine_on(
    device: &Device,
    scene: &Scene,
    targets: &Views,
    options: &RefineOptions,
    observe: &mut dyn FnMut(Step) -> ControlFlow<()>,
) -> Result<Refined, RefineError> {
    scene.validate()?;
    let targets = Target::all(targets, options.ssim as f32, scene.canonical_camera.as_ref())?;
    let mut run = Run::new(device, scene, targets, options);
    if run.targets.is_empty() || scene.is_empty() {
        return Ok(run.untouched());
    }
    let total = options.color_iterations + options.iterations;
    let first = run.look(0)?;
    run.note(first);
    for (phase, iterations) in [
        (Wanted::COLORS, options.color_iterations),
        (Wanted::ALL, options.iterations),
    ] {
        for step in 1..=iterations {
            if run.status == Status::NotFinite {
                break;
            }
            run.step(phase, total)?;
            let seen = Step {
                iteration: run.done,
                total,
                loss: run.curve.last().map_or(f64::NAN, |p| p.loss),
            };
            if observe(seen).is_break() {
                return Err(RefineError::Interrupted);
            }
            if step % options.check_every.max(1) == 0 || step == iterations {
                let before = run.curve.last().map_or(f64::INFINITY, |p| p.loss);
                let now = run.look(run.done)?;
                run.note(now);
                if (before - now.loss).abs() < options.tolerance * before.abs() {
                    run.status = if run.status == Status::NotFinite {
                        run.status
                    } else {
                        Status::Converged
                    };
                    break;
                }
            }
        }
        // The next phase starts from the best of this one.
        run.return_to_best();
    }
    run.finish()
}

struct Run<'a> {
    device: &'a Device,
    options: &'a RefineOptions,
    targets: Vec<Target>,
    /// Views in the order of steps, each as often as its share says.
    schedule: Vec<usize>,
    anchored: Anchored,
    /// Frames of all targets while only colours move.
    frames: Vec<Frame>,
    done: usize,
    curve: Vec<Point>,
    best: (f64, usize, Scene),
    status: Status,
    skipped: usize,
    fidelity: Vec<Fidelity>,
}

impl<'a> Run<'a> {
    fn new(device: &'a Device, scene: &Scene, targets: Vec<Target>, options: &'a RefineOptions) -> Self {
        Self {
            device,
            fidelity: targets
                .iter()
                .map(|t| Fidelity {
                    view: t.view,
                    ..Fidelity::default()
                })
                .collect(),
            schedule: schedule(&targets),
            options,
            targets,
            anchored: Anchored::new(scene, options),
            frames: Vec::new(),
            done: 0,
            curve: Vec::new(),
            best: (f64::INFINITY, 0, scene.clone()),
            status: Status::Finished,
            skipped: 0,
        }
    }

    fn untouched(self) -> Refined {
        Refined {
            scene: self.best.2,
            curve: self.curve,
            best_iteration: 0,
            status: Status::NothingToFit,
            skipped: 0,
            fidelity: self.fidelity,
        }
    }

    fn frame(&self, view: usize) -> Result<Frame, DeviceError> {
        let camera = &self.targets[view].camera;
        self.device
            .frame(&self.anchored.scene, camera, &self.options.render, Outputs::RGBA)
    }

    /// One step on the next few views.
    fn step(&mut self, phase: Wanted, total: usize) -> Result<(), DeviceError> {
        let views = self.targets.len();
        let each = self.options.views_per_step.clamp(1, views);
        if phase == Wanted::COLORS && self.frames.is_empty() {
            self.frames = (0..views).map(|view| self.frame(view)).collect::<Result<_, _>>()?;
        }
        if phase == Wanted::ALL {
            self.frames.clear();
        }
        // The gradient of the sum over all views, estimated from a few. A view's frequency in the schedule is its share
        // of the sum, so that all get the same factor.
        let scale = views as f64 / each as f64;
        for k in 0..each {
            let view = self.schedule[(self.done * each + k) % self.schedule.len()];
            let mut fresh;
            let frame = if phase == Wanted::COLORS {
                self.frames[view].recolor(&self.anchored.scene);
                &mut self.frames[view]
            } else {
                fresh = self.frame(view)?;
                &mut fresh
            };
            let picture = frame.draw(&self.anchored.scene)?;
            let pixels = self.targets[view].gradient(&picture, scale as f32);
            let gradients = frame.backward(&self.anchored.scene, &picture, &pixels, phase)?;
            self.anchored.gather(&gradients);
        }
        let decay = libm::pow(0.1, self.done as f64 / total.max(1) as f64);
        self.skipped += self.anchored.step(phase, decay);
        self.done += 1;
        Ok(())
    }

    /// The loss on all views.
    fn look(&mut self, iteration: usize) -> Result<Point, DeviceError> {
        let mut data = 0.0;
        for view in 0..self.targets.len() {
            let picture = if let Some(frame) = self.frames.get_mut(view) {
                frame.recolor(&self.anchored.scene);
                frame.draw(&self.anchored.scene)?
            } else {
                self.frame(view)?.draw(&self.anchored.scene)?
            };
            data += self.targets[view].share * self.targets[view].loss(&picture);
            if iteration == 0 {
                self.fidelity[view].before = self.targets[view].psnr(&picture);
            }
        }
        let anchor = self.anchored.anchor_loss();
        Ok(Point {
            iteration,
            loss: data + anchor,
            data,
            anchor,
        })
    }

    /// Keeps the scene if it is the best so far.
    fn note(&mut self, point: Point) {
        if !point.loss.is_finite() {
            self.status = Status::NotFinite;
            return;
        }
        self.curve.push(point);
        if point.loss < self.best.0 {
            self.best = (point.loss, point.iteration, self.anchored.scene.clone());
        }
    }

    fn return_to_best(&mut self) {
        self.anchored.scene.clone_from(&self.best.2);
    }

    fn finish(mut self) -> Result<Refined, RefineError> {
        self.return_to_best();
        self.frames.clear();
        for view in 0..self.targets.len() {
            let picture = self.frame(view)?.draw(&self.anchored.scene)?;
            self.fidelity[view].after = self.targets[view].psnr(&picture);
        }
        Ok(Refined {
            scene: self.best.2,
            curve: self.curve,
            best_iteration: self.best.1,
            status: self.status,
            skipped: self.skipped,
            fidelity: self.fidelity,
        })
    }
}

/// Every view in turn; if one is the canonical one, it comes before each of the others.
fn schedule(targets: &[Target]) -> Vec<usize> {
    let front = targets.iter().position(|t| t.is_canonical);
    let others = (0..targets.len()).filter(|&k| Some(k) != front);
    match front {
        Some(front) if targets.len() > 1 => others.flat_map(|k| [front, k]).collect(),
        _ => (0..targets.len()).collect(),
    }
}

#[cfg(test)]
mod tests;
