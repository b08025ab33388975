//! A registry of three small nodes, for the tests of this crate.

use std::sync::Arc;

use gear_graph::{
    AnyValue, Context, Graph, GraphInput, Input, Inputs, Node, NodeError, Number, Outputs, Params, Registry, Report,
    Want,
};
use serde_json::json;

use crate::study::Samples;

/// A graph of them; `FACTOR` is to be replaced.
pub const ANSWER: &str = "\
gear: 1
inputs: {note: Report}
nodes:
  scaled:  {node: Scale, in: {note: note}, with: {factor: FACTOR}}
  rounded: {node: Round, in: {number: scaled.number}}
  sign:    {node: Sign, in: {number: rounded.number}}
outputs: {rounded: rounded.number, sign: sign.number}
";

/// The number x of a report, times a factor; an error if there is none.
#[derive(Clone, Debug, Params)]
pub struct Scale {
    /// The factor.
    #[param(default = 1.0, range = -1e6..=1e6)]
    pub factor: f64,
}

/// Input of [`Scale`].
#[derive(Inputs)]
pub struct Note {
    /// A report with x.
    pub note: Arc<Report>,
}

/// A number in.
#[derive(Inputs)]
pub struct In {
    /// The number.
    pub number: Arc<Number>,
}

/// A number out.
#[derive(Outputs)]
pub struct Out {
    /// The number.
    pub number: Arc<Number>,
}

fn out(number: f64) -> Result<Out, NodeError> {
    Ok(Out {
        number: Arc::new(Number(number)),
    })
}

impl Node for Scale {
    const NAME: &str = "Scale";
    const VERSION: u32 = 1;
    type Inputs = Note;
    type Outputs = Out;

    fn run(&self, inputs: Note, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let x = inputs.note.0["x"]
            .as_f64()
            .ok_or_else(|| NodeError::new("the note has no x"))?;
        out(x * self.factor)
    }
}

/// The nearest multiple of a unit.
#[derive(Clone, Debug, Params)]
pub struct Round {
    /// The unit.
    #[param(default = 1.0, above = 0.0, range = 0.0..=1e6)]
    pub unit: f64,
}

impl Node for Round {
    const NAME: &str = "Round";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        out((inputs.number.0 / self.unit).round() * self.unit)
    }
}

/// −1, 0 or 1.
#[derive(Clone, Debug, Params)]
pub struct Sign {}

impl Node for Sign {
    const NAME: &str = "Sign";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let number = inputs.number.0;
        out(if number == 0.0 { 0.0 } else { number.signum() })
    }
}

/// The nodes.
pub fn registry() -> Registry {
    let mut registry = Registry::new();
    registry.node::<Scale>();
    registry.node::<Round>();
    registry.node::<Sign>();
    registry
}

/// Notes as samples: `one`, `two` and `three` hold x = 1, 2, 3 plus a tenth of the seed; `none` holds nothing.
pub struct Notes;

impl Samples for Notes {
    fn names(&self) -> Vec<String> {
        ["one", "two", "three", "none"].map(str::to_owned).into()
    }

    fn flaw(&self, sample: &str) -> Option<String> {
        let mut parts = sample.split(',');
        let name = parts.next().unwrap_or_default();
        if !self.names().contains(&name.to_owned()) {
            return Some(format!("there is no note {name}"));
        }
        parts
            .find(|part| !part.starts_with("seed="))
            .map(|part| format!("there is no option {part}"))
    }

    fn input(&self, sample: &str, _input: &GraphInput, _graph: &Graph) -> Result<Input, String> {
        let (name, seed) = sample.split_once(",seed=").unwrap_or((sample, "0"));
        let seed: f64 = seed.parse().map_err(|_| format!("{seed} is no seed"))?;
        let at = self
            .names()
            .iter()
            .position(|known| known == name)
            .ok_or("no such note")?;
        let report = match name {
            "none" => json!({}),
            _ => json!({"x": at as f64 + 1.0 + 0.1 * seed}),
        };
        Ok(Input::Value(AnyValue::new(Report(report))))
    }
}
