//! `gear graphs`: the graphs that come with gear.

use std::path::Path;

use crate::args::GraphsCommand;
use crate::bundle::File;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;
use crate::graphs::{self, Shipped, experiments, shipped};

pub fn graphs(command: &GraphsCommand, console: &Console) -> Result<Exit, CliError> {
    match command {
        GraphsCommand::List => {
            let all = || shipped().iter().chain(experiments());
            let width = all().map(|graph| graph.name.len() + 1).max().unwrap_or(0);
            for graph in all() {
                console.result(&format!("{:<width$}  {}", format!("@{}", graph.name), graph.summary()));
            }
        }
        GraphsCommand::Copy { name, to } => {
            let wanted: Vec<&Shipped> = match name {
                Some(name) => vec![graphs::find(name.trim_start_matches('@').trim_end_matches(".yaml"))?],
                None => shipped().iter().chain(experiments()).collect(),
            };
            copy(&wanted, to, console)?;
        }
    }
    Ok(Exit::Done)
}

/// Copies all or, if a file is in the way, none.
fn copy(wanted: &[&Shipped], to: &Path, console: &Console) -> Result<(), CliError> {
    let folder = Folder::probe(to)?;
    let name = |graph: &Shipped| format!("{}.yaml", graph.name);
    for graph in wanted {
        let file = to.join(name(graph));
        if file.exists() {
            return Err(CliError::InTheWay { file });
        }
    }
    for graph in wanted {
        let path = folder.write(&File::new(name(graph), graph.text.as_bytes().to_vec()))?;
        console.result(&path.display().to_string());
    }
    Ok(())
}
