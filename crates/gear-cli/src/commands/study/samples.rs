//! Samples for experiments: what `--input NAME=sample:…` gives.

use std::ffi::OsString;

use gear_graph::{Graph, GraphInput, GraphSource, Input};
use gear_study::study::Samples;

use crate::inputs;

/// Paints samples with `gear-sample`.
pub struct Painter;

impl Samples for Painter {
    fn names(&self) -> Vec<String> {
        gear_sample::names().iter().map(ToString::to_string).collect()
    }

    fn flaw(&self, sample: &str) -> Option<String> {
        // What a graph with one picture says to it.
        let text = "gear: 1\ninputs: {painting: Image}\noutputs: {painting: painting}\n";
        let graph = GraphSource::new("sample", text).check(&crate::registry()).ok()?;
        let painting = graph.inputs().first()?;
        self.input(sample, painting, &graph).err()
    }

    fn input(&self, sample: &str, input: &GraphInput, graph: &Graph) -> Result<Input, String> {
        let given = [OsString::from(format!("{}=sample:{sample}", input.name))];
        let parsed = inputs::parse(&given, graph).map_err(|error| error.to_string())?;
        let parsed = parsed.into_iter().next().map(|(_, input)| input);
        parsed.ok_or_else(|| format!("there is no sample `{sample}`"))
    }
}
