//! Refines a scene against target views, held to the geometry that it came with.
//!
//! Minimises  Σ_views mean_W[(1 − λ_s)|R − T|₁ + λ_s (1 − SSIM)] + λ Σ_a w_a mean‖x_a − x⁰_a‖²  over the attributes of
//! all Gaussians (paper, Eq. 9–10; GaussianEditor's anchor). Adam follows the data term; the anchor is taken implicitly in
//! Adam's own metric, x⁺ = (P ŷ + ημ x⁰)/(P + ημ), which is stable for any weight. First only colours move, then
//! everything. The best scene that was seen is the result. See `gear_splat::refine`.

use std::ops::ControlFlow;
use std::sync::Arc;

use gear_graph::{
    Choice, Context, Inputs, Node, NodeError, Outputs, Params, Registry, Report, Resources, Want, Wanted,
};
use gear_splat::refine::{
    self, Checkpoints, Generations, Prune, Rates, RefineError, RefineOptions, Refined, Status, Step,
};
use gear_splat::{Device, Scene, Views};
use serde_json::{Value, json};

/// Fits a scene to target views without letting it drift from where it started.
#[derive(Clone, Debug, Params)]
pub struct Refine {
    /// Steps in which only colours move.
    #[param(default = 30, range = 0..=100_000)]
    pub color_iterations: u32,

    /// How the colours move in these steps.
    #[param(default = ColorSolver::Adam)]
    pub color_solver: ColorSolver,

    /// Steps in which everything moves.
    #[param(default = 270, range = 0..=100_000)]
    pub iterations: u32,

    /// Steps of conjugate gradients on the colours in the end, with the shapes that were found.
    #[param(default = 0, range = 0..=100_000)]
    pub final_color_iterations: u32,

    /// Views looked at in each step; the canonical view comes every other time.
    #[param(default = 1, range = 1..=1000)]
    pub views_per_step: u32,

    /// Share of structural similarity in the data term; the rest is absolute difference.
    #[param(default = 0.2, range = 0.0..=1.0)]
    pub ssim: f64,

    /// Weight of the anchor. 0 lets the scene go, a huge one returns it as it came.
    #[param(default = 1.0, range = 0.0..=1e30)]
    pub anchor: f64,

    /// The anchor's weight for centres, per squared typical surfel.
    #[param(default = 0.05, range = 0.0..=1e30)]
    pub anchor_center: f64,

    /// The anchor's weight for rotations (quaternions).
    #[param(default = 1.0, range = 0.0..=1e30)]
    pub anchor_rotation: f64,

    /// The anchor's weight for the logarithms of scales.
    #[param(default = 0.05, range = 0.0..=1e30)]
    pub anchor_scale: f64,

    /// The anchor's weight for the logits of opacities.
    #[param(default = 0.05, range = 0.0..=1e30)]
    pub anchor_opacity: f64,

    /// The anchor's weight for SH coefficients.
    #[param(default = 0.002, range = 0.0..=1e30)]
    pub anchor_color: f64,

    /// How firmly the anchor holds the scene as it came, as a factor of all its weights.
    #[param(default = 1.0, range = 0.0..=1e6)]
    pub generation_first: f64,

    /// The same of Gaussians that a densification makes.
    #[param(default = 0.1, range = 0.0..=1e6)]
    pub generation_newborn: f64,

    /// By this much each later densification makes every Gaussian firmer.
    #[param(default = 1.3, range = 1.0..=1e3)]
    pub generation_multiplier: f64,

    /// The firmness at which that ends.
    #[param(default = 10.0, range = 0.0..=1e6)]
    pub generation_most: f64,

    /// Factor of all step sizes. 0 keeps the scene as it is.
    #[param(default = 1.0, range = 0.0..=1000.0)]
    pub rate: f64,

    /// Step size of centres, in typical surfels. An attribute with the step 0 is frozen and costs nothing.
    #[param(default = 0.02, range = 0.0..=1000.0)]
    pub rate_center: f64,

    /// Step size of rotations (quaternions).
    #[param(default = 2e-3, range = 0.0..=1000.0)]
    pub rate_rotation: f64,

    /// Step size of the logarithms of scales.
    #[param(default = 0.04, range = 0.0..=1000.0)]
    pub rate_scale: f64,

    /// Step size of the logits of opacities.
    #[param(default = 0.05, range = 0.0..=1000.0)]
    pub rate_opacity: f64,

    /// Step size of SH coefficients; those of higher degrees step at a twentieth.
    #[param(default = 0.1, range = 0.0..=1000.0)]
    pub rate_color: f64,

    /// Steps between looks at the loss on all views.
    #[param(default = 25, range = 1..=100_000)]
    pub check_every: u32,

    /// A phase ends when the loss fell by less than this share between two looks.
    #[param(default = 1e-4, range = 0.0..=1.0)]
    pub tolerance: f64,

    /// Whether Gaussians are added where the loss asks for them.
    #[param(default = Densify::Never)]
    pub densify: Densify,

    /// Gaussians with less opacity are left out of the result.
    #[param(default = 0.0, range = 0.0..=1.0)]
    pub prune_opacity: f64,

    /// Leaves out of the result what no target sees, as long as no pixel of them changes by more than 1/255. The back of a
    /// scene that is looked at from the front is lost.
    #[param(default = false)]
    pub prune_unseen: bool,
}

/// How the colours of fixed shapes are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum ColorSolver {
    /// Adam, a few views a step.
    Adam,
    /// Conjugate gradients on all views in every step: slower, and as far down as the loss goes.
    ConjugateGradients,
}

/// When Gaussians are added. In YAML: `densify: never`, `densify: strained`, `densify: {strained: {share: 0.02}}`.
#[derive(Clone, Copy, Debug, PartialEq, Choice)]
pub enum Densify {
    /// Their number stays.
    Never,
    /// Those that the loss pulls about most on the screen get a twin, or are split if they are large.
    Strained {
        /// Steps between densifications.
        #[param(default = 50, range = 1..=100_000)]
        every: u32,
        /// Share of all steps after which there is none any more.
        #[param(default = 0.6, range = 0.0..=1.0)]
        until: f64,
        /// Share of the Gaussians that is densified each time.
        #[param(default = 0.01, range = 0.0..=1.0)]
        share: f64,
        /// Largest number of Gaussians.
        #[param(default = 1_000_000, range = 0..=100_000_000)]
        most: u32,
    },
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The scene, which is also the anchor.
    pub scene: Arc<Scene>,
    /// What its views should look like, with a weight for each pixel. Without weights, covered pixels count.
    pub targets: Arc<Views>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// The refined scene.
    pub scene: Wanted<Scene>,
    /// The loss over the steps, fidelity before and after, and why it ended.
    pub curve: Wanted<Report>,
}

impl Node for Refine {
    const NAME: &str = "Refine";
    const VERSION: u32 = 5;
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        Device::lent(resources).realm()
    }

    fn run(&self, inputs: In, want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let (scene, targets) = (inputs.scene, inputs.targets);
        scene.validate().map_err(|e| NodeError::input("scene", e.to_string()))?;
        let (valid, dropped) = scene.without_invalid();
        if dropped > 0 {
            ctx.note(format!("{dropped} Gaussians were not finite and are left out"));
        }
        let device = Device::lent(ctx.resources());
        let mut kept = Kept(ctx);
        let refined = refine::refine_resuming(&device, &valid, &targets, &self.options(), &mut kept, &mut |step| {
            observe(step, ctx)
        });
        let refined = refined.map_err(|error| match error {
            RefineError::Interrupted => NodeError::Cancelled,
            RefineError::Device(e) => e.into(),
            RefineError::Scene(e) => NodeError::input("scene", e.to_string()),
            RefineError::View { .. } => NodeError::input("targets", error.to_string()),
        })?;
        tell(&refined, ctx);
        let report = want.try_compute("curve", || Report::new(report(&refined, &targets)))?;
        Ok(Out {
            scene: want.compute("scene", || refined.scene),
            curve: report,
        })
    }
}

impl Refine {
    fn options(&self) -> RefineOptions {
        RefineOptions {
            color_iterations: self.color_iterations as usize,
            color_solver: match self.color_solver {
                ColorSolver::Adam => refine::ColorSolver::Adam,
                ColorSolver::ConjugateGradients => refine::ColorSolver::ConjugateGradients,
            },
            iterations: self.iterations as usize,
            final_color_iterations: self.final_color_iterations as usize,
            views_per_step: self.views_per_step as usize,
            ssim: self.ssim,
            anchor: self.anchor,
            anchor_weights: Rates {
                center: self.anchor_center,
                rotation: self.anchor_rotation,
                scale: self.anchor_scale,
                opacity: self.anchor_opacity,
                color: self.anchor_color,
            },
            rates: Rates {
                center: self.rate_center,
                rotation: self.rate_rotation,
                scale: self.rate_scale,
                opacity: self.rate_opacity,
                color: self.rate_color,
            }
            .scaled(self.rate),
            check_every: self.check_every as usize,
            tolerance: self.tolerance,
            generations: Generations {
                first: self.generation_first,
                newborn: self.generation_newborn,
                multiplier: self.generation_multiplier,
                most: self.generation_most,
            },
            densify: self.densify.options(),
            prune: Prune {
                opacity: self.prune_opacity,
                unseen: self.prune_unseen,
            },
            render: RefineOptions::default().render,
        }
    }
}

impl Densify {
    fn options(self) -> Option<refine::Densify> {
        match self {
            Self::Never => None,
            Self::Strained {
                every,
                until,
                share,
                most,
            } => Some(refine::Densify {
                every: every as usize,
                until,
                share,
                most: most as usize,
            }),
        }
    }
}

/// An unfinished refinement, kept by the run for the next one.
struct Kept<'a>(&'a Context);

impl Checkpoints for Kept<'_> {
    fn last(&mut self) -> Option<Vec<u8>> {
        self.0.unfinished()
    }

    fn keep(&mut self, state: &dyn Fn() -> Vec<u8>) {
        self.0.keep_unfinished(state);
    }

    fn keep_last(&mut self, state: &dyn Fn() -> Vec<u8>) {
        self.0.keep_unfinished_now(&state());
    }
}

fn observe(step: Step, ctx: &Context) -> ControlFlow<()> {
    let done = step.iteration as f64 / step.total.max(1) as f64;
    ctx.progress_with(done, format!("loss {:.4}", step.loss));
    if ctx.is_cancelled() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

fn tell(refined: &Refined, ctx: &Context) {
    match refined.status {
        Status::NotFinite => ctx.note("the loss was not a number; the best scene before that is kept"),
        Status::NothingToFit => ctx.note("no target has a pixel with a weight; the scene is as it came"),
        Status::Converged | Status::Finished => {}
    }
    if refined.skipped > 0 {
        ctx.note(format!(
            "{} gradients were not finite and were skipped",
            refined.skipped
        ));
    }
    if refined.born > 0 {
        ctx.note(format!("{} Gaussians were added", refined.born));
    }
    if refined.pruned > 0 {
        ctx.note(format!("{} Gaussians do not show and are left out", refined.pruned));
    }
}

fn report(refined: &Refined, targets: &Views) -> Value {
    let status = match refined.status {
        Status::Converged => "converged",
        Status::Finished => "finished",
        Status::NotFinite => "not finite",
        Status::NothingToFit => "nothing to fit",
    };
    let curve: Vec<Value> = refined
        .curve
        .iter()
        .map(|p| json!({"iteration": p.iteration, "loss": p.loss, "data": p.data, "anchor": p.anchor}))
        .collect();
    // Views without any weight are no targets; the others keep their order.
    let fidelity: Vec<Value> = refined
        .fidelity
        .iter()
        .map(|p| json!({"view": targets.views.get(p.view).map(|v| &v.name), "psnr_before": p.before, "psnr_after": p.after}))
        .collect();
    json!({
        "status": status,
        "best_iteration": refined.best_iteration,
        "skipped_gradients": refined.skipped,
        "born": refined.born,
        "pruned": refined.pruned,
        "curve": curve,
        "fidelity": fidelity,
    })
}

/// Adds the node to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Refine>();
}

#[cfg(test)]
mod tests;
