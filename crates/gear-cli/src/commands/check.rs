//! `gear check`: every mistake of a graph file at once.

use gear_graph::Registry;

use crate::args::GraphArgs;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::graphs;

pub fn check(args: &GraphArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let graph = graphs::open(args, registry)?;
    if !graph.warnings().is_empty() {
        console.remark(graph.warnings().render(console.colour()).trim_end());
    }
    console.result(&format!(
        "{}: no mistakes; {} inputs, {} nodes, {} outputs",
        graph.name(),
        graph.inputs().len(),
        graph.nodes().len(),
        graph.outputs().len()
    ));
    Ok(Exit::Done)
}
