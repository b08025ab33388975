//! `gear plan`: what a run would do. Setting a run up is the same for `gear run`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gear_graph::{Digest, Graph, PlannedState, Registry, Run, Store};
use gear_service::Services;
use gear_splat::{Device, Fallback};

use crate::args::PlanArgs;
use crate::artefacts::Artefacts;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::{graphs, inputs, outputs};

pub fn plan(args: &PlanArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let store = look_at_store(args, console);
    let graph = open(args, registry, store.as_deref(), console)?;
    let run = set_up(args, &graph, store)?;
    let plan = run.plan().map_err(CliError::Run)?;
    let width = plan.nodes.iter().map(|node| node.id.len()).max().unwrap_or(0);
    for node in &plan.nodes {
        let state = match node.state {
            PlannedState::Runs => "runs",
            PlannedState::MayRun => "may run",
            PlannedState::Cached => "stored",
            PlannedState::LeftOut => "left out",
            PlannedState::Given => "given",
            PlannedState::NotGiven => "not given (optional)",
        };
        let seconds = node
            .seconds
            .map(|s| format!(" ({s:.1} s when it ran)"))
            .unwrap_or_default();
        let reason = if node.reason.is_empty() {
            String::new()
        } else {
            format!("  {}", node.reason)
        };
        console.result(format!("{:<width$}  {state:<8}{seconds}{reason}", node.id).trim_end());
        for port in &node.elided {
            console.result(&format!(
                "{:<width$}  does without `{}`: {}",
                "", port.port, port.reason
            ));
        }
    }
    Ok(Exit::Done)
}

/// Opens the graph and shows its warnings.
pub fn open(args: &PlanArgs, registry: &Registry, store: Option<&Store>, console: &Console) -> Result<Graph, CliError> {
    let graph = graphs::open_in(&args.graph, registry, store)?;
    if !graph.warnings().is_empty() {
        console.remark(graph.warnings().render(console.colour()).trim_end());
    }
    Ok(graph)
}

/// The store that the arguments ask for, to work with; it is made if it is not there, but not among other files.
pub fn open_store(args: &PlanArgs, console: &Console) -> Result<Option<Arc<Store>>, CliError> {
    not_among_files(args.store.as_deref().filter(|_| !args.no_cache))?;
    Ok(store_path(args, console).map(|path| Arc::new(Store::open(path))))
}

/// Refuses a folder that was named for a store and holds something else.
pub fn not_among_files(store: Option<&Path>) -> Result<(), CliError> {
    match store.and_then(|path| Some((path.to_path_buf(), Store::in_the_way(path)?))) {
        Some((path, holds)) => Err(CliError::NotForAStore { path, holds }),
        None => Ok(()),
    }
}

/// The same, to look at: nothing is made and nothing is written.
pub fn look_at_store(args: &PlanArgs, console: &Console) -> Option<Arc<Store>> {
    store_path(args, console).map(|path| Arc::new(Store::look_at(path)))
}

fn store_path(args: &PlanArgs, console: &Console) -> Option<PathBuf> {
    if args.no_cache {
        return None;
    }
    let path = args.store.clone().or_else(Store::default_path);
    if path.is_none() {
        console.warning("there is no cache folder here; give one with --store DIR, or nothing is kept");
    }
    path
}

/// The run that the arguments ask for.
pub fn set_up<'g>(args: &PlanArgs, graph: &'g Graph, store: Option<Arc<Store>>) -> Result<Run<'g>, CliError> {
    let mut run = Run::new(graph);
    for (name, input) in inputs::parse(&args.input, graph)? {
        run = run.input(name, input);
    }
    if !args.output.is_empty() {
        run = run.outputs(args.output.clone());
    }
    if let Some(jobs) = args.jobs {
        run = run.jobs(usize::from(jobs));
    }
    for node in &args.fresh {
        run = run.fresh(node.clone());
    }
    let fallback = Fallback::telling(|why| Console::new().warning(why)).unless_required();
    run = run.resource(Device::open(&args.device, fallback).map_err(CliError::Device)?);
    run = run.resource(Services::from_process());
    if let Some(file) = &args.onnxruntime {
        run = run.resource(gear_onnx::LibraryFile(file.clone()));
    }
    if args.no_elision {
        run = run.no_elision();
    }
    if args.cache_nondeterministic {
        run = run.cache_nondeterministic();
    }
    Ok(match store {
        Some(store) => {
            // A value that the store lost is computed again only where its files are lost as well.
            let files = Artefacts::new(Some(Arc::clone(&store)));
            let lacks_files = move |output: &str, digest: &Digest| !files.has(&outputs::kind(output), digest);
            run.store(store).with_values_where(lacks_files)
        }
        None => run,
    })
}
