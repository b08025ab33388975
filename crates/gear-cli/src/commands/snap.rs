//! `gear snap`: pins what ports of a graph give, and tells what moved.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::Args;
use gear_graph::graph::nearest;
use gear_graph::{Registry, RunStatus};
use gear_splat::DeviceChoice;
use gear_study::snap::{self, Comparison, State};

use crate::args::{GraphArgs, PlanArgs};
use crate::console::Console;
use crate::error::{CliError, Exit};

use super::plan::{open, open_store, set_up};

/// `gear snap`.
#[derive(Debug, Args)]
pub struct SnapArgs {
    /// A graph file with `snapshots:`
    pub graph: String,
    /// Give an input of the graph [default: what the pinned snapshots were made from]
    #[arg(long, value_name = "NAME=PATH|sample:NAME")]
    pub input: Vec<String>,
    /// Only compare, write no snapshot; exit code 1 if one moved, is missing or is stale
    #[arg(long, conflicts_with = "accept")]
    pub check: bool,
    /// Take the new value of a snapshot, or of all if none is named
    #[arg(long, value_name = "NAME", num_args = 0..)]
    pub accept: Option<Vec<String>>,
    /// Where the page with the pictures goes when something moved
    #[arg(long, value_name = "FILE", default_value = "snapshots.html")]
    pub page: PathBuf,
    /// Threads in all
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Where results are kept between runs [default: $GEAR_STORE, or `gear` in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub store: Option<PathBuf>,
    /// Keep nothing and use nothing that was kept
    #[arg(long, conflicts_with = "store")]
    pub no_cache: bool,
    /// What rasterises. The bits of a GPU are not those of the CPU: pin and check on the same one
    #[arg(long, value_name = "auto|cpu|gpu[:NAME]", default_value = "cpu")]
    pub device: DeviceChoice,
}

pub fn snap(args: &SnapArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let refuse = |cause: String| CliError::Snap { cause };
    if args.graph.starts_with('@') {
        return Err(refuse(format!(
            "`{}` comes with gear, and snapshots stand beside a file; begin one with `extends: '{}'`",
            args.graph, args.graph
        )));
    }
    let folder = snap::folder_of(Path::new(&args.graph));
    let given = inputs(args, &folder).map_err(refuse)?;
    let plan = PlanArgs {
        graph: GraphArgs {
            graph: args.graph.clone(),
            set: Vec::new(),
        },
        input: given
            .iter()
            .map(|(name, value)| format!("{name}={}", from_here(value, args)).into())
            .collect(),
        output: Vec::new(),
        jobs: args.jobs,
        store: args.store.clone(),
        fresh: Vec::new(),
        no_cache: args.no_cache,
        cache_nondeterministic: false,
        device: args.device.clone(),
        no_elision: false,
        onnxruntime: None,
    };
    let store = open_store(&plan, console)?;
    let graph = open(&plan, registry, store.as_deref(), console)?.into_snapshots();
    if graph.snapshots().is_empty() {
        return Err(refuse(format!(
            "{} pins nothing; add `snapshots: {{name: node.port}}`",
            args.graph
        )));
    }
    let named = names(args, graph.snapshots().iter().map(|s| s.name.as_str()).collect()).map_err(refuse)?;
    let outcome = set_up(&plan, &graph, store)?.go().map_err(CliError::Run)?;
    for failure in &outcome.report.failures {
        console.failure(&failure.to_string());
    }
    if outcome.report.status == RunStatus::Interrupted {
        return Ok(Exit::Interrupted);
    }
    let comparison = snap::compare(&graph, &outcome, &folder, &given).map_err(|e| refuse(e.to_string()))?;
    let taken = take(args, &comparison, &folder, named, console)?;
    tell(&comparison, &taken, args, console)
}

/// Pins what is asked for; the names of what was pinned.
fn take(
    args: &SnapArgs,
    comparison: &Comparison,
    folder: &Path,
    named: Option<BTreeSet<String>>,
    console: &Console,
) -> Result<BTreeSet<String>, CliError> {
    if args.check {
        return Ok(BTreeSet::new());
    }
    let all = named.as_ref().is_some_and(BTreeSet::is_empty);
    let wanted = comparison.snapshots.iter().filter(|s| match (&named, &s.state) {
        (_, State::Same | State::Failed) => false,
        (None, state) => matches!(state, State::Missing),
        (Some(names), _) => all || names.contains(&s.name),
    });
    let taken: BTreeSet<String> = wanted.map(|s| s.name.clone()).collect();
    let failed = |e: snap::SnapError| CliError::SnapFiles { cause: e.to_string() };
    for file in snap::accept(comparison, folder, &taken).map_err(failed)? {
        console.result(&file.display().to_string());
    }
    if all {
        for name in &comparison.unknown {
            snap::forget(folder, name).map_err(failed)?;
            console.note(&format!("the snapshot `{name}` is gone; the graph does not have it"));
        }
    }
    Ok(taken)
}

/// Tells what became of each, and writes the page if something is to be looked at.
fn tell(
    comparison: &Comparison,
    taken: &BTreeSet<String>,
    args: &SnapArgs,
    console: &Console,
) -> Result<Exit, CliError> {
    for snapshot in &comparison.snapshots {
        let pinned = if taken.contains(&snapshot.name) {
            "  → pinned"
        } else {
            ""
        };
        console.result(&format!("{}{pinned}", snap::line(snapshot)));
        if !snapshot.state.passes() {
            for told in snap::moved_most(&snapshot.numbers, 8) {
                console.result(&format!("{:16}   {told}", ""));
            }
        }
    }
    if args.accept.as_ref().is_none_or(|names| !names.is_empty()) {
        for name in &comparison.unknown {
            console.warning(&format!(
                "the snapshot `{name}` is pinned, but the graph does not have it; `--accept` without a name removes it"
            ));
        }
    }
    let open: Vec<_> = comparison
        .snapshots
        .iter()
        .filter(|s| !s.state.passes() && !taken.contains(&s.name))
        .collect();
    if open.is_empty() {
        return Ok(Exit::Done);
    }
    if open
        .iter()
        .any(|s| matches!(s.state, State::Moved(_) | State::Reshaped(_) | State::Stale(_)))
    {
        let failed = |cause: String| CliError::SnapFiles { cause };
        let html = snap::page(&args.graph, comparison).map_err(|e| failed(e.to_string()))?;
        gear_image::io::write_atomically(&args.page, html.as_bytes()).map_err(|e| failed(e.to_string()))?;
        console.remark(&format!("before, after and difference are in {}", args.page.display()));
    }
    let names: Vec<_> = open.iter().map(|s| s.name.as_str()).collect();
    console.remark(&format!(
        "{} of {} are not as they were pinned; if they are right: gear snap {} --accept {}",
        open.len(),
        comparison.snapshots.len(),
        args.graph,
        names.join(" ")
    ));
    Ok(Exit::Failed)
}

/// The names behind `--accept`, if it is there; empty for all.
fn names(args: &SnapArgs, known: Vec<&str>) -> Result<Option<BTreeSet<String>>, String> {
    let Some(names) = &args.accept else {
        return Ok(None);
    };
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        let help = match nearest(name, known.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("there are {}", known.join(", ")),
        };
        return Err(format!("--accept {name}: {} has no such snapshot; {help}", args.graph));
    }
    Ok(Some(names.iter().cloned().collect()))
}

/// What is given for inputs: files by their path from the graph's folder, so that it means the same wherever the
/// repository is checked out.
fn inputs(args: &SnapArgs, folder: &Path) -> Result<BTreeMap<String, String>, String> {
    if args.input.is_empty() {
        return snap::pinned_inputs(folder).map_err(|e| e.to_string());
    }
    let mut given = BTreeMap::new();
    for input in &args.input {
        let (name, value) = input
            .split_once('=')
            .ok_or_else(|| format!("--input {input}: expected NAME=PATH or NAME=sample:NAME"))?;
        given.insert(name.to_owned(), from_graph(value, &args.graph));
    }
    Ok(given)
}

/// A file by its path from the graph's folder, with `/`; as it is if it does not lie below it.
fn from_graph(value: &str, graph: &str) -> String {
    let folder = Path::new(graph)
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let both = || Some((std::path::absolute(value).ok()?, std::path::absolute(folder).ok()?));
    match both() {
        Some((file, folder)) if !value.starts_with("sample:") => match file.strip_prefix(folder) {
            Ok(below) => below.to_string_lossy().replace('\\', "/"),
            Err(_) => value.to_owned(),
        },
        _ => value.to_owned(),
    }
}

/// The same path from where the command runs.
fn from_here(value: &str, args: &SnapArgs) -> String {
    let below = Path::new(&args.graph).parent().map(|folder| folder.join(value));
    match below.filter(|file| !value.starts_with("sample:") && file.exists()) {
        Some(file) => file.to_string_lossy().into_owned(),
        None => value.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_below_the_graph_is_named_from_its_folder() {
        assert_eq!(from_graph("graphs/p/a.png", "graphs/g.yaml"), "p/a.png");
        assert_eq!(from_graph("a.png", "g.yaml"), "a.png");
        assert_eq!(from_graph("../a.png", "graphs/g.yaml"), "../a.png");
        assert_eq!(from_graph("sample:vessel", "graphs/g.yaml"), "sample:vessel");
    }
}
