//! The command line of `gear`: arguments, progress, exit codes, and the files that a run leaves. No algorithm.
//!
//! A team with nodes of its own builds its own binary from this crate:
//!
//! ```no_run
//! let mut registry = gear_cli::registry();
//! // registry.node::<my_nodes::Weathering>();
//! gear_cli::main_with(&registry);
//! ```
//!
//! | file | what it holds |
//! |---|---|
//! | `args` | the arguments, as `clap` reads them |
//! | `registry` | the list of node types and loaders |
//! | `graphs` | the graphs that are embedded in the binary |
//! | `plugins` | the nodes of plugins: named, configured, or known and not installed |
//! | `commands` | one file a command |
//! | `inputs` | `--input NAME=PATH` and `sample:NAME` |
//! | `results`, `outputs`, `bundle`, `folder` | values as files, written so that no half file stands under a final name |
//! | `artefacts`, `gallery`, `page` | pictures of a run and the page that shows them |
//! | `scenes` | scenes and cameras given as files |
//! | `sizes` | bytes and times, as people write them |
//! | `words` | what the page says about pictures and numbers |
//! | `progress` | progress bars, or a line a node |

mod args;
mod artefacts;
mod bundle;
mod commands;
mod console;
mod error;
mod folder;
mod gallery;
mod graphs;
mod inputs;
mod outputs;
mod page;
mod plugins;
mod progress;
mod registry;
mod results;
mod scenes;
mod sizes;
mod words;

pub use graphs::{Shipped, library, shipped};
pub use plugins::{ShippedPlugin, shipped_plugins, with_shipped};
pub use registry::registry;

use std::process::ExitCode;

use clap::Parser;
use gear_graph::{Registry, Threads};
use tracing_subscriber::fmt::format::FmtSpan;

use args::{Arguments, Command};
use console::Console;
use error::{CliError, Exit};

/// Reads the arguments of the process, does what they ask for with the nodes of `registry`, and says how it ended:
/// 0 done, 1 a node failed or a result could not be written, 2 the user's mistake, 130 interrupted.
///
/// Help and version go to standard output, mistakes in the arguments to standard error.
pub fn main_with(registry: &Registry) -> ExitCode {
    let console = Console::new();
    log();
    let result = match Arguments::try_parse() {
        Ok(arguments) => threads().and_then(|()| obey(&arguments, registry, &console)),
        Err(answer) if answer.use_stderr() => {
            let _ = answer.print();
            Ok(Exit::Mistake)
        }
        Err(help) => {
            console.keep(help.print());
            Ok(Exit::Done)
        }
    };
    // Results that nobody got are no results; a failure before that tells more.
    let exit = match result {
        Ok(Exit::Done) => console.complete().map(|()| Exit::Done),
        other => other,
    };
    let exit = exit.unwrap_or_else(|error| {
        console.error(&error);
        error.exit()
    });
    ExitCode::from(match exit {
        Exit::Done => 0,
        Exit::Failed => 1,
        Exit::Mistake => 2,
        Exit::Interrupted => 130,
    })
}

/// Starts the threads that work outside of a run, as many as there are cores or as can be started. Left to itself,
/// their pool would start them at its first use, and panic where it cannot.
fn threads() -> Result<(), CliError> {
    let asked = std::env::var("RAYON_NUM_THREADS").ok();
    let asked = asked
        .and_then(|number| number.parse().ok())
        .filter(|number| *number > 0);
    let wanted = asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let none = |error: std::io::Error| CliError::NoThreads {
        cause: error.to_string(),
    };
    let threads = Threads::start(wanted, "outside", None).map_err(none)?;
    if let Err(error) = threads.into_global_pool() {
        tracing::debug!(%error, "the threads outside of runs are somebody else's");
    }
    Ok(())
}

/// Does what the arguments ask for, with the nodes of plugins where nodes are asked for.
fn obey(arguments: &Arguments, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    if !arguments.command.needs_plugins() {
        return dispatch(&arguments.command, registry, console);
    }
    let registry = plugins::with_plugins(registry, &arguments.plugins, console)?;
    dispatch(&arguments.command, &registry, console)
}

fn dispatch(command: &Command, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    match command {
        Command::Run(options) => commands::run::run(options, registry, console),
        Command::Check(options) => commands::check::check(options, registry, console),
        Command::Plan(options) => commands::plan::plan(&options.run, registry, console),
        Command::Why(options) => commands::why::why(options, registry, console),
        Command::Cache(command) => commands::cache::cache(command, registry, console),
        Command::Nodes(options) => commands::nodes::nodes(options, registry, console),
        Command::NewNode(options) => commands::new_node::new_node(options, registry, console),
        Command::Plugin(command) => commands::plugin::plugin(command, registry, console),
        Command::NewPlugin(options) => commands::new_plugin::new_plugin(options, registry, console),
        Command::Graph(options) => commands::graph::graph(options, registry, console),
        Command::Schema => commands::schema::schema(registry, console),
        Command::Graphs(options) => commands::graphs::graphs(options, console),
        Command::Convert(options) => commands::convert::convert(options, console),
        Command::Render(options) => commands::render::render(options, console),
        Command::Sample(options) => commands::sample::sample(options, console),
        Command::Study(options) => commands::study::study(options, registry, console),
        Command::Curve(options) => commands::curve::curve(options, registry, console),
        Command::Diff(options) => commands::diff::diff(options, registry, console),
        Command::Stress(options) => commands::stress::stress(options, registry, console),
        Command::Snap(options) => commands::snap::snap(options, registry, console),
        Command::Ballot(options) => commands::ballot::ballot(options, console),
    }
}

/// What happens inside, on standard error, for those who ask: `GEAR_LOG=info`, or any filter of `tracing`.
fn log() {
    if let Ok(filter) = std::env::var("GEAR_LOG") {
        tracing_subscriber::fmt()
            .with_env_filter(tracing_subscriber::EnvFilter::new(filter))
            .with_span_events(FmtSpan::NEW | FmtSpan::CLOSE)
            .with_writer(std::io::stderr)
            .init();
    }
}
