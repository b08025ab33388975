//! `gear graph`: a graph as the source of a drawing.

use gear_graph::Registry;

use crate::args::{DrawArgs, DrawFormat};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::graphs;

pub fn graph(args: &DrawArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let graph = graphs::open(&args.graph, registry)?;
    let drawn = match args.format {
        DrawFormat::Mermaid => graph.to_mermaid(),
        DrawFormat::Dot => graph.to_dot(),
    };
    console.result(drawn.trim_end());
    Ok(Exit::Done)
}
