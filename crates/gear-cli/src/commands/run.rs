//! `gear run`: runs a graph and writes what it puts out.
//!
//! The order matters. Everything that can be wrong with what was asked for is found before anything runs and before
//! anything is written. A file that cannot be decoded is found only while it is loaded: what does not depend on it is
//! finished and written all the same, and where nothing is left, nothing is written at all.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use gear_graph::{Cancel, Event, FailureKind, Graph, PlannedState, Registry, Run, RunReport, RunStatus};

use crate::args::RunArgs;
use crate::artefacts::Artefacts;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::{Folder, RECORD};
use crate::gallery::Gallery;
use crate::inputs;
use crate::plugins::ShippedPlugin;
use crate::progress::{Progress, Show};
use crate::results::{PAGE, Place, Results, foreseen};

use super::plan::{open, open_store, set_up};

pub fn run(args: &RunArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let store = open_store(&args.run, console)?;
    let graph = open(&args.run, registry, store.as_deref(), console)?;
    let mut run = set_up(&args.run, &graph, store.clone())?;
    let folder = Folder::probe(&args.out)?;
    spare_what_is_read(&folder, args, &graph)?;
    spare_what_is_there(&folder, args, &graph)?;
    if !args.keep_going {
        refuse_what_is_absent(&run, &graph)?;
    }
    let artefacts = Arc::new(Artefacts::new(store.clone()));
    let gallery = Arc::new(Gallery::open(Arc::clone(&artefacts)));
    let progress = Arc::new(Progress::new(how_to_show(args.quiet, console)));

    let observer = {
        let (gallery, progress) = (Arc::clone(&gallery), Arc::clone(&progress));
        move |event: &Event<'_>| {
            gallery.event(event);
            progress.event(event);
            tell(event, &progress);
        }
    };
    if args.fail_fast {
        run = run.fail_fast();
    }
    if let Some(limit) = args.memory {
        run = run.memory_limit(limit);
    }
    let interrupted = interruption();
    let run = run.cancel(interrupted.clone()).observer(Arc::new(observer));
    let mut outcome = run.go().map_err(CliError::Run)?;
    progress.finish();
    gallery.finish();

    for failure in &outcome.report.failures {
        console.failure(&failure.to_string());
    }
    let bad_input = outcome
        .report
        .failures
        .iter()
        .any(|failure| failure.kind == FailureKind::Load);
    let stopped = || {
        console.remark("interrupted; what was computed is kept, and the next run goes on from there");
        Ok(Exit::Interrupted)
    };
    if outcome.report.status == RunStatus::Interrupted {
        return stopped();
    }
    let told = outcome.report.failures.len();
    let results = Results::gather(&mut outcome, &artefacts);
    for failure in &outcome.report.failures[told..] {
        console.failure(&failure.to_string());
    }
    // A value that the store had lost was being computed again.
    if !results.all_made() && interrupted.is_raised() {
        return stopped();
    }
    if bad_input && results.is_empty() {
        return Ok(Exit::Mistake);
    }
    let place = Place {
        folder: &folder,
        force: args.force,
        console,
    };
    let missing = results.write(&place, &outcome.report, &graph, &gallery)?;
    for error in &missing {
        console.error(error);
    }
    if let Some(store) = &store {
        // Pictures and files that were made just now; another process may have locked the store's folder.
        store.flush_unless(&|| interrupted.is_raised());
        for warning in store.warnings() {
            console.warning(&warning);
        }
    }
    if !args.quiet {
        console.remark(&summary(&outcome.report));
    }
    Ok(match (bad_input, outcome.report.status) {
        (true, _) => Exit::Mistake,
        (false, RunStatus::Done) if missing.is_empty() => Exit::Done,
        (false, _) => Exit::Failed,
    })
}

/// Refuses a run that would come to a node of a plugin that is not installed. Only a graph that has one is planned.
fn refuse_what_is_absent(run: &Run<'_>, graph: &Graph) -> Result<(), CliError> {
    let absent: Vec<_> = graph
        .nodes()
        .iter()
        .filter_map(|node| Some((node, ShippedPlugin::absent(node.spec.plugin)?)))
        .collect();
    if absent.is_empty() {
        return Ok(());
    }
    let plan = run.plan().map_err(CliError::Run)?;
    let state = |id: &str| plan.node(id).map(|node| node.state);
    let needs = |wanted: PlannedState, remark: &str| -> Vec<String> {
        let needed = absent.iter().filter(|(node, _)| state(&node.id) == Some(wanted));
        needed
            .map(|(node, plugin)| format!("  {} ({}){remark}: {}", node.id, node.spec.name, plugin.install()))
            .collect()
    };
    let mut needed = needs(PlannedState::Runs, "");
    if needed.is_empty() {
        return Ok(()); // what only may run is found out by running
    }
    needed.extend(needs(PlannedState::MayRun, ", which may run"));
    Err(CliError::PluginsAbsent { needed })
}

/// Whether an output is asked for.
fn wanted(args: &RunArgs) -> impl Fn(&str) -> bool {
    let asked = &args.run.output;
    move |name| asked.is_empty() || asked.iter().any(|output| output == name)
}

/// Refuses to write results over the files that the run reads.
fn spare_what_is_read(folder: &Folder, args: &RunArgs, graph: &Graph) -> Result<(), CliError> {
    let files = args.run.input.iter().filter_map(|input| Some(inputs::split(input)?.1));
    let files = files.filter(|file| inputs::sample_name(file).is_none());
    let wanted = wanted(args);
    let names: BTreeSet<&str> = graph
        .outputs()
        .iter()
        .map(|o| o.name.as_str())
        .filter(|o| wanted(o))
        .collect();
    for file in files.chain([args.run.graph.graph.as_ref()]) {
        if let Some(name) = folder.name_of(Path::new(file))
            && (name == RECORD || name == PAGE || names.contains(name.split(['.', '/']).next().unwrap_or_default()))
        {
            return Err(CliError::OutFolder {
                folder: args.out.clone(),
                cause: format!(
                    "`{name}` in it is read by this run, and a result may take its name; choose another folder"
                ),
            });
        }
    }
    Ok(())
}

/// Refuses to write results over files that no run wrote, as far as their names are known already.
fn spare_what_is_there(folder: &Folder, args: &RunArgs, graph: &Graph) -> Result<(), CliError> {
    if args.force {
        return Ok(());
    }
    let names = foreseen(graph, wanted(args));
    match folder.stranger(&names, &folder.recorded(), &|_| None) {
        Some(file) => Err(folder.taken(&file)),
        None => Ok(()),
    }
}

fn how_to_show(quiet: bool, console: &Console) -> Show {
    match (quiet, console.interactive()) {
        (true, _) => Show::Nothing,
        (false, true) => Show::Bars,
        (false, false) => Show::Lines,
    }
}

/// What the first Ctrl-C raises. The second ends the process.
pub fn interruption() -> Cancel {
    let cancel = Cancel::new();
    let raised = cancel.clone();
    let installed = ctrlc::set_handler(move || {
        if raised.raise() {
            std::process::exit(130);
        }
    });
    if let Err(error) = installed {
        tracing::warn!(%error, "Ctrl-C will end the process at once");
    }
    cancel
}

/// What people should hear while the run goes on.
fn tell(event: &Event<'_>, progress: &Progress) {
    let console = Console::new();
    match event {
        Event::Warning { message } => progress.between(|| console.warning(message)),
        Event::Note { node, note } => progress.between(|| console.note(&format!("{node}: {note}"))),
        _ => {}
    }
}

/// One line: how long, what ran, what came from the store.
fn summary(report: &RunReport) -> String {
    let count = |status| report.with_status(status).len();
    let memory = report
        .peak_memory
        .map(|peak| format!(", {} MiB at most", peak >> 20))
        .unwrap_or_default();
    format!(
        "{:.1} s{memory}: {} ran, {} from the store, {} left out",
        report.seconds,
        report.ran().len(),
        count(gear_graph::NodeStatus::Cached),
        count(gear_graph::NodeStatus::LeftOut),
    )
}
