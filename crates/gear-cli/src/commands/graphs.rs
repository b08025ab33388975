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
    let mut files = Vec::new();
    for graph in wanted {
        files.push((format!("{}.yaml", graph.name), graph.text));
        // An experiment without its collection would not run.
        files.extend(graphs::manifest_of(graph.name).map(|(name, text)| (name.to_owned(), text)));
    }
    for (name, _) in &files {
        let file = to.join(name);
        if file.exists() {
            return Err(CliError::InTheWay { file });
        }
    }
    for (name, text) in files {
        let path = folder.write(&File::new(name, text.as_bytes().to_vec()))?;
        console.result(&path.display().to_string());
    }
    Ok(())
}
