//! Judge: blind judgement of several methods' renderings by a multimodal model (the paper's Table 2).
//!
//! In every vote the model sees the painting and, under letters, the views of each method in an order drawn for that
//! vote. It scores texture fidelity (TF), geometric accuracy (GA), view consistency (VC) and aesthetic consistency (AC)
//! from 1 to 10, by written rubrics, as JSON. An answer that does not hold what was asked for is sent back with what is
//! wrong, a few times. Orders are balanced: over as many votes as there are methods, each stands in each place once.
//!
//! Besides the means the report tells how far votes agree (the mean rank correlation of two votes) and how much the
//! place mattered (the largest deviation of a place's mean score). A judge that prefers the first picture shows there.

mod sheet;
mod tally;
mod verdict;
mod votes;

pub use verdict::Verdict;

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, OrAuto, Outputs, Params, Registry, Report, Resources, Want};
use gear_image::Image;
use gear_service::{Kind, Patience, Services};
use gear_splat::Views;

/// Blind judgement of renderings by a multimodal model.
#[derive(Clone, Debug, Params)]
pub struct Judge {
    /// Names of the methods, in the order of the wires at `views`.
    #[param(default = Vec::new())]
    pub methods: Vec<String>,
    /// How often the model is asked.
    #[param(default = 6, range = 1..=100)]
    pub votes: u32,
    /// Seed of the orders, and of the service if it has one.
    #[param(default = 0, range = 0..=1_000_000_000)]
    pub seed: u64,
    /// Longer side of one view as the model sees it.
    #[param(default = 256, range = 16..=2048, unit = "px")]
    pub size: usize,
    /// Views of each method that are shown, spread over all.
    #[param(default = 5, range = 1..=16)]
    pub shown: usize,
    /// How freely the model answers; `auto` says nothing, for models that know no temperature.
    #[param(default = OrAuto::Value(0.0), range = 0.0..=2.0)]
    pub temperature: OrAuto<f64>,
    /// How often an answer that cannot be used is sent back, in each vote.
    #[param(default = 2, range = 0..=10)]
    pub repairs: u32,
    /// How patient it is with the service.
    #[param(flatten)]
    pub patience: Patience,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The painting.
    pub painting: Arc<Image>,
    /// The views of each method, a wire a method.
    pub views: Vec<Arc<Views>>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// `methods` (scores TF, GA, VC, AC and their mean, with the spread over votes), `agreement`, `position_bias`, and
    /// every vote with its order.
    pub report: Arc<Report>,
}

impl Node for Judge {
    const NAME: &str = "Judge";
    const VERSION: u32 = 1;
    const DETERMINISTIC: bool = false;
    const KEPT: bool = true;
    type Inputs = In;
    type Outputs = Out;

    fn realm(&self, resources: &Resources) -> String {
        Services::lent(resources).realm(Kind::Chat)
    }

    fn run(&self, inputs: In, _want: &Want, ctx: &Context) -> Result<Out, NodeError> {
        let methods = self.names(inputs.views.len())?;
        let sheets = sheet::of_methods(&inputs.painting, &inputs.views, self.size, self.shown)?;
        let interrupted = || ctx.is_cancelled();
        let bench = votes::Bench::open(self, &sheets, ctx, &interrupted)?;
        let mut votes = Vec::new();
        for number in 0..self.votes {
            let fraction = f64::from(number) / f64::from(self.votes);
            ctx.progress_with(fraction, format!("vote {} of {}", number + 1, self.votes));
            votes.push(bench.vote(number)?);
        }
        let asked = Services::lent(ctx.resources()).realm(Kind::Chat);
        Ok(Out {
            report: Arc::new(Report(tally::report(&methods, &votes, &asked))),
        })
    }
}

impl Judge {
    fn names(&self, wires: usize) -> Result<Vec<String>, NodeError> {
        if wires < 2 || wires > tally::LETTERS.len() {
            let most = tally::LETTERS.len();
            return Err(NodeError::input(
                "views",
                format!("found {wires} methods; expected 2 to {most}, a wire each"),
            ));
        }
        if self.methods.is_empty() {
            return Ok((1..=wires).map(|i| format!("method {i}")).collect());
        }
        if self.methods.len() != wires {
            let found = self.methods.len();
            return Err(NodeError::param(
                "methods",
                format!("found {found} names for {wires} wires at `views`"),
            ));
        }
        Ok(self.methods.clone())
    }
}

/// Adds the nodes to a registry.
pub fn register(registry: &mut Registry) {
    registry.node::<Judge>();
    registry.node::<Verdict>();
}

#[cfg(test)]
mod tests;
