//! `gear stress`: the catalogue of stiff and extreme cases on a node, a graph, or every node.

use std::time::Duration;

use clap::Args;
use gear_graph::graph::nearest;
use gear_graph::{NodeType, Registry, Resources};
use gear_splat::{Device, DeviceChoice, Fallback};
use gear_study::stress::{self, Catalogue, Options, Row};

use crate::args::{GraphArgs, TextFormat};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::graphs;
use crate::sizes::counted;

/// `gear stress`.
#[derive(Debug, Args)]
pub struct StressArgs {
    /// A node type, a graph file, or `@NAME` for a graph that comes with gear; every node if it is not given
    #[arg(value_name = "GRAPH|NODE")]
    pub what: Option<String>,
    /// Change a parameter; the value is YAML. Of a node: PARAM=VALUE
    #[arg(long, value_name = "[NODE.]PARAM=VALUE", requires = "what")]
    pub set: Vec<String>,
    /// Leave out values that take more memory, such as the scene of a million Gaussians
    #[arg(long, value_name = "SIZE", value_parser = crate::sizes::parse)]
    pub largest: Option<u64>,
    /// Seconds after which a node hangs
    #[arg(long, value_name = "SECONDS", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..))]
    pub patience: u64,
    /// What rasterises
    #[arg(long, value_name = "auto|cpu|gpu[:NAME]", default_value = "cpu")]
    pub device: DeviceChoice,
    /// Use this catalogue in place of gear's own
    #[arg(long, value_name = "FILE")]
    pub cases: Option<std::path::PathBuf>,
    /// Print the catalogue itself, in Markdown, and run nothing
    #[arg(long, conflicts_with_all = ["what", "format"])]
    pub catalogue: bool,
    /// For people, or for programs on standard output
    #[arg(long, value_enum, default_value_t = TextFormat::Text)]
    pub format: TextFormat,
}

pub fn stress(args: &StressArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let catalogue = catalogue(args, registry).map_err(|cause| CliError::Stress { cause })?;
    if args.catalogue {
        console.result(stress::catalogue_markdown(&catalogue).trim_end());
        return Ok(Exit::Done);
    }
    let fallback = Fallback::telling(|why| Console::new().warning(why)).unless_required();
    let device = Device::open(&args.device, fallback).map_err(CliError::Device)?;
    let options = Options {
        largest: args
            .largest
            .map_or(usize::MAX, |bytes| usize::try_from(bytes).unwrap_or(usize::MAX)),
        patience: Duration::from_secs(args.patience),
        resources: Resources::default().with(device.clone()),
    };
    // A node that panics is a row; what the runtime says of it besides is noise.
    std::panic::set_hook(Box::new(|_| {}));
    let mut tell = |row: &Row| {
        if args.format == TextFormat::Text {
            console.result(&stress::text(row));
        }
    };
    let mut rows = Vec::new();
    match args.what.as_deref() {
        None => {
            for node_type in registry.nodes() {
                rows.extend(node(&catalogue, node_type, args, registry, &options, &mut tell)?);
            }
        }
        Some(name) => match registry.find_node(name) {
            Some(node_type) => rows = node(&catalogue, node_type, args, registry, &options, &mut tell)?,
            None => {
                let given = GraphArgs {
                    graph: name.to_owned(),
                    set: args.set.clone(),
                };
                let graph = match graphs::source(&given) {
                    Ok(source) => source.check(registry).map_err(CliError::Graph)?,
                    // A word is a node that was misspelt rather than a file.
                    Err(_) if !name.contains(['@', '.', '/', '\\']) => return Err(unknown(name, registry)),
                    Err(error) => return Err(error.into()),
                };
                let lend = device.clone();
                rows = stress::stress_graph(
                    &catalogue,
                    &graph,
                    &options,
                    &|run| run.resource(lend.clone()),
                    &mut tell,
                );
            }
        },
    }
    let surprises = rows.iter().filter(|row| row.surprise.is_some()).count();
    match args.format {
        TextFormat::Json => console.result(&format!("{:#}", stress::json(&rows))),
        TextFormat::Text => console.remark(&format!(
            "{}, {}",
            counted(rows.len(), "case"),
            counted(surprises, "surprise")
        )),
    }
    Ok(if surprises > 0 { Exit::Failed } else { Exit::Done })
}

/// The catalogue that comes with gear, or the one that is given.
fn catalogue(args: &StressArgs, registry: &Registry) -> Result<Catalogue, String> {
    match &args.cases {
        None => Catalogue::shipped(registry).map_err(|e| e.to_string()),
        Some(file) => {
            let text = std::fs::read_to_string(file).map_err(|e| format!("--cases {}: {e}", file.display()))?;
            Catalogue::read(&text, registry).map_err(|e| format!("--cases {}: {e}", file.display()))
        }
    }
}

/// The sweep of a node, and its cases.
fn node(
    catalogue: &Catalogue,
    node_type: &NodeType,
    args: &StressArgs,
    registry: &Registry,
    options: &Options,
    tell: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, CliError> {
    let refuse = |cause: String| CliError::Stress { cause };
    let with = params(&args.set).map_err(refuse)?;
    let mut rows = stress::stress_node(catalogue, node_type, &with, options, tell).map_err(refuse)?;
    if args.set.is_empty() {
        for case in catalogue.cases.iter().filter(|case| case.node == node_type.spec.name) {
            let row = stress::stress_case(catalogue, case, registry, options);
            tell(&row);
            rows.push(row);
        }
    }
    Ok(rows)
}

/// `PARAM=VALUE` as parameters of one node.
fn params(set: &[String]) -> Result<serde_json::Map<String, serde_json::Value>, String> {
    let mut params = serde_json::Map::new();
    for text in set {
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| format!("--set {text}: expected PARAM=VALUE, such as `radius=0.05`"))?;
        let value = gear_study::yaml(value).map_err(|cause| format!("--set {text}: {cause}"))?;
        params.insert(name.to_owned(), value);
    }
    Ok(params)
}

fn unknown(name: &str, registry: &Registry) -> CliError {
    let names: Vec<_> = registry.nodes().map(|node| node.spec.name).collect();
    CliError::UnknownNode {
        name: name.to_owned(),
        help: match nearest(name, names.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("there are {}; a graph is a file, or `@NAME`", names.join(", ")),
        },
    }
}
