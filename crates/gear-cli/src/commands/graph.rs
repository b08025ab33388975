//! `gear graph`: a graph as the source of a drawing, or as one file.

use gear_graph::Registry;

use crate::args::{DrawArgs, DrawFormat};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::graphs;

pub fn graph(args: &DrawArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let text = if args.resolved {
        let resolved = graphs::source(&args.graph)?.resolve(registry);
        resolved.map_err(CliError::Graph)?
    } else {
        let graph = graphs::open(&args.graph, registry)?;
        match args.format {
            DrawFormat::Mermaid => graph.to_mermaid(),
            DrawFormat::Dot => graph.to_dot(),
        }
    };
    console.result(text.trim_end());
    Ok(Exit::Done)
}
