//! `gear plan`: what a run would do. Setting a run up is the same for `gear run`.

use std::sync::Arc;

use gear_graph::{Graph, PlannedState, Registry, Run, Store};

use crate::args::PlanArgs;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::{graphs, inputs};

pub fn plan(args: &PlanArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let graph = open(args, registry, console)?;
    let (run, _) = set_up(args, &graph, console)?;
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
pub fn open(args: &PlanArgs, registry: &Registry, console: &Console) -> Result<Graph, CliError> {
    let graph = graphs::open(&args.graph, registry)?;
    if !graph.warnings().is_empty() {
        console.remark(graph.warnings().render(console.colour()).trim_end());
    }
    Ok(graph)
}

/// The run that the arguments ask for, and the store that it uses.
pub fn set_up<'g>(
    args: &PlanArgs,
    graph: &'g Graph,
    console: &Console,
) -> Result<(Run<'g>, Option<Arc<Store>>), CliError> {
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
    if args.no_cache {
        return Ok((run, None));
    }
    let Some(path) = args.store.clone().or_else(Store::default_path) else {
        console.warning("there is no cache folder here; give one with --store DIR, or nothing is kept");
        return Ok((run, None));
    };
    let store = Arc::new(Store::open(path));
    Ok((run.store(Arc::clone(&store)), Some(store)))
}
