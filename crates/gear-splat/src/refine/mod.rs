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
//!
//! With fixed shapes a picture is linear in the colours, so that the first phase can also be solved by conjugate gradients
//! ([`ColorSolver`]): slower, and as far down as the loss goes.

mod anchored;
mod checkpoint;
mod colors;
mod curvature;
mod density;
mod loss;
pub mod prox;
mod prune;
mod ssim;

use std::ops::ControlFlow;

use crate::device::{Device, DeviceError, Frame};
use crate::render::{PixelGradients, Wanted};
use crate::{Outputs, RenderOptions, Scene, SceneError, Views};
use anchored::Anchored;
use density::Strain;
use loss::Target;
use ssim::Scratch;

pub use anchored::Rates;
pub use checkpoint::Checkpoints;
pub use density::{Densify, Generations};
pub use prune::Prune;

/// What refinement looks at.
const DRAWN: Outputs = Outputs {
    rgb: true,
    alpha: false,
    depth: false,
    median_depth: false,
    normal: false,
};

/// How the colours are found while the shapes stand still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorSolver {
    /// A few views a step.
    #[default]
    Adam,
    /// All views in every step: the converged reference.
    ConjugateGradients,
}

/// How to refine.
#[derive(Clone, Debug, PartialEq)]
pub struct RefineOptions {
    /// Steps in which only colours move.
    pub color_iterations: usize,
    /// How they move in these.
    pub color_solver: ColorSolver,
    /// Steps in which everything moves.
    pub iterations: usize,
    /// Steps of conjugate gradients on the colours in the end, with the shapes that were found.
    pub final_color_iterations: usize,
    /// Views looked at in each step.
    pub views_per_step: usize,
    /// λ_s: share of structural similarity in the data term, 0 to 1.
    pub ssim: f64,
    /// λ: the anchor's weight, 0 or more.
    pub anchor: f64,
    /// w_a: the anchor's weight for each attribute.
    pub anchor_weights: Rates,
    /// Adam's step for each attribute. Each decays by ten over a run. An attribute with the step 0 stays as it is, and
    /// costs nothing.
    ///
    /// Centres, here and in `anchor_weights`, are measured in the scene's typical surfel (the median of the larger
    /// standard deviations), so that the same scene at twice the resolution is the same problem.
    pub rates: Rates,
    /// Steps between looks at the loss on all views.
    pub check_every: usize,
    /// A phase ends when the loss fell by less than this share since the last look.
    pub tolerance: f64,
    /// How firmly the anchor holds Gaussians by their generation.
    pub generations: Generations,
    /// Whether Gaussians are added where the loss asks for them.
    pub densify: Option<Densify>,
    /// What is left out in the end.
    pub prune: Prune,
    /// How views are rendered.
    pub render: RenderOptions,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            color_iterations: 30,
            color_solver: ColorSolver::Adam,
            iterations: 270,
            final_color_iterations: 0,
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
            generations: Generations::default(),
            densify: None,
            prune: Prune::default(),
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
    /// Gaussians that densifications made.
    pub born: usize,
    /// Gaussians that were left out in the end.
    pub pruned: usize,
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
    refine_resuming(device, scene, targets, options, &mut (), observe)
}

/// [`refine_on`], going on from the state that `checkpoints` has of the same scene, targets and options, and handing it
/// the state at every look and when it is broken off. The result is that of an uninterrupted run, to the bit.
pub fn refine_resuming(
    device: &Device,
    scene: &Scene,
    targets: &Views,
    options: &RefineOptions,
    checkpoints: &mut dyn Checkpoints,
    observe: &mut dyn FnMut(Step) -> ControlFlow<()>,
) -> Result<Refined, RefineError> {
    scene.validate()?;
    let targets = Target::all(targets, options.ssim as f32, scene.canonical_camera.as_ref())?;
    let mut run = Run::new(device, scene, targets, options);
    if run.targets.is_empty() || scene.is_empty() {
        return Ok(run.untouched());
    }
    if checkpoints.last().and_then(|state| run.restore(&state)).is_none() {
        let first = run.look(0)?;
        run.note(first);
    }
    let phases = [
        (Wanted::COLORS, options.color_iterations, options.color_solver),
        (Wanted::ALL, options.iterations, ColorSolver::Adam),
        (
            Wanted::COLORS,
            options.final_color_iterations,
            ColorSolver::ConjugateGradients,
        ),
    ];
    while let Some(&(phase, iterations, solver)) = phases.get(run.phase) {
        let wanted = run.anchored.wanted(phase);
        if iterations > 0 && (wanted.moves_shapes() || wanted.colors) {
            if solver == ColorSolver::ConjugateGradients {
                run.solve_colors(iterations, checkpoints, observe)?;
            } else {
                run.descend(phase, iterations, checkpoints, observe)?;
            }
        }
        // The next phase starts from the best of this one.
        run.return_to_best();
        (run.phase, run.step) = (run.phase + 1, 0);
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
    /// Room for the gradient by a picture, used again by every step.
    pixels: PixelGradients,
    scratch: Scratch,
    /// Number of the phase, and the steps done in it.
    phase: usize,
    step: usize,
    /// Steps done in all.
    done: usize,
    /// ε of the next round of conjugate gradients.
    corner: f32,
    curve: Vec<Point>,
    best: (f64, usize, Scene),
    status: Status,
    skipped: usize,
    /// What the next densification will go by.
    strain: Strain,
    born: usize,
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
            pixels: PixelGradients::default(),
            scratch: Scratch::default(),
            phase: 0,
            step: 0,
            done: 0,
            corner: colors::CORNER,
            curve: Vec::new(),
            best: (f64::INFINITY, 0, scene.clone()),
            status: Status::Finished,
            skipped: 0,
            strain: Strain::default(),
            born: 0,
        }
    }

    /// Steps there may be.
    fn total(&self) -> usize {
        self.options.color_iterations + self.options.iterations + self.options.final_color_iterations
    }

    /// Tells of the step that was just done.
    fn tell(&self, observe: &mut dyn FnMut(Step) -> ControlFlow<()>) -> Result<(), RefineError> {
        let seen = Step {
            iteration: self.done,
            total: self.total(),
            loss: self.curve.last().map_or(f64::NAN, |p| p.loss),
        };
        match observe(seen) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(RefineError::Interrupted),
        }
    }

    fn untouched(self) -> Refined {
        Refined {
            scene: self.best.2,
            curve: self.curve,
            best_iteration: 0,
            status: Status::NothingToFit,
            skipped: 0,
            born: 0,
            pruned: 0,
            fidelity: self.fidelity,
        }
    }

    fn frame(&self, view: usize) -> Result<Frame, DeviceError> {
        let camera = &self.targets[view].camera;
        self.device
            .frame(&self.anchored.scene, camera, &self.options.render, DRAWN)
    }

    /// Makes the frames of all targets, to be drawn again and again in other colours.
    fn keep_frames(&mut self) -> Result<(), DeviceError> {
        if self.frames.is_empty() {
            self.frames = (0..self.targets.len())
                .map(|view| self.frame(view))
                .collect::<Result<_, _>>()?;
        }
        Ok(())
    }

    /// Adam's steps of a phase, until the loss no longer falls.
    fn descend(
        &mut self,
        phase: Wanted,
        iterations: usize,
        checkpoints: &mut dyn Checkpoints,
        observe: &mut dyn FnMut(Step) -> ControlFlow<()>,
    ) -> Result<(), RefineError> {
        while self.step < iterations && self.status != Status::NotFinite {
            self.take_step(phase)?;
            self.step += 1;
            if phase == Wanted::ALL {
                self.densify_if_due();
            }
            let told = self.tell(observe);
            let is_look = self.step.is_multiple_of(self.options.check_every.max(1)) || self.step == iterations;
            let ends = is_look && self.look_ends_phase()?;
            match told {
                Err(_) if !ends => checkpoints.keep_last(&|| self.state()),
                Ok(()) if is_look && !ends => checkpoints.keep(&|| self.state()),
                _ => {}
            }
            told?;
            if ends {
                break;
            }
        }
        Ok(())
    }

    /// Looks at all views; true when the loss no longer falls or is not a number.
    fn look_ends_phase(&mut self) -> Result<bool, DeviceError> {
        let before = self.curve.last().map_or(f64::INFINITY, |p| p.loss);
        let now = self.look(self.done)?;
        self.note(now);
        if self.status != Status::NotFinite && (before - now.loss).abs() < self.options.tolerance * before.abs() {
            self.status = Status::Converged;
            return Ok(true);
        }
        Ok(self.status == Status::NotFinite)
    }

    fn densify_if_due(&mut self) {
        let Some(densify) = &self.options.densify else { return };
        let last = densify.until * self.total() as f64;
        if self.step.is_multiple_of(densify.every.max(1)) && self.done as f64 <= last {
            self.born += self.anchored.densify(&self.strain, densify);
            self.strain = Strain::default();
        }
    }

    /// One step on the next few views.
    fn take_step(&mut self, phase: Wanted) -> Result<(), DeviceError> {
        let views = self.targets.len();
        let each = self.options.views_per_step.clamp(1, views);
        if phase == Wanted::COLORS {
            self.keep_frames()?;
        } else {
            self.frames.clear();
        }
        let wanted = self.anchored.wanted(phase);
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
            self.targets[view].gradient(&picture, scale as f32, &mut self.scratch, &mut self.pixels);
            let gradients = frame.backward(&self.anchored.scene, &picture, &self.pixels, wanted)?;
            if phase == Wanted::ALL && self.options.densify.is_some() {
                let camera = &self.targets[view].camera;
                self.strain.gather(&gradients, &self.anchored.scene.centers, camera);
            }
            self.anchored.gather(gradients);
        }
        let descending = self.options.color_iterations + self.options.iterations;
        let decay = libm::pow(0.1, self.done as f64 / descending.max(1) as f64);
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
        let pruned = self.prune()?;
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
            born: self.born,
            pruned,
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
