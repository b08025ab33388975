//! Names, types, wires and parameters → [`Graph`].
//!
//! Nothing here stops at the first mistake: a name that is not found costs only what hangs on it.

mod order;
mod wires;

use std::collections::HashMap;
use std::sync::Arc;

use self::order::order;
pub(super) use self::order::readers;
use self::wires::Checker;
use super::file::{File, FileInput, FileNode};
use super::overlay::Unset;
use super::{Graph, GraphInput, GraphNode, GraphOutput, GraphSnapshot, Wire, nearest};
use crate::params::unknown_parameter;
use crate::{Fields, NodeError, NodeSpec, ParamSpec, Problem, Registry, Severity, Span, Spanned, Tree, TreeKind};

/// What a name in the file stands for.
struct Names<'f> {
    inputs: HashMap<&'f str, u32>,
    nodes: HashMap<&'f str, u32>,
    /// Registered type of every node, if it is known.
    specs: Vec<Option<Arc<NodeSpec>>>,
}

/// Checks a file against the registry. `None` if something is missing from the graph because of a mistake.
pub fn check(name: &str, file: &File<'_>, registry: &Registry, problems: &mut Vec<Problem>) -> Option<Graph> {
    let names = Names {
        inputs: numbered(file.inputs.iter().map(|input| input.name)),
        nodes: numbered(file.nodes.iter().map(|node| node.id)),
        specs: file
            .nodes
            .iter()
            .map(|node| find_type(node, registry, problems))
            .collect(),
    };
    for node in &file.nodes {
        if let Some(input) = names.inputs.get(node.id.value.as_str()) {
            problems.push(
                Problem::error(
                    "duplicate-name",
                    format!("`{}` is the name of an input and of a node", node.id.value),
                    node.id.span,
                    "the node",
                )
                .label(file.inputs[*input as usize].name.span, "the input")
                .help("give one of them another name"),
            );
        }
    }
    let inputs: Vec<_> = file
        .inputs
        .iter()
        .map(|input| read_input(input, registry, problems))
        .collect();
    let nodes: Vec<_> = file
        .nodes
        .iter()
        .zip(&names.specs)
        .map(|(node, spec)| read_node(node, spec.as_ref()?, registry, problems))
        .collect();

    // Slots are numbered by the known types; what has no known type has no slots, and its readers were reported.
    let mut first_slot = Vec::with_capacity(inputs.len() + nodes.len() + 1);
    let mut site_of = Vec::new();
    for outputs in inputs.iter().map(|_| 1).chain(
        names
            .specs
            .iter()
            .map(|spec| spec.as_ref().map_or(0, |spec| spec.outputs.len())),
    ) {
        let site = first_slot.len() as u32;
        first_slot.push(site_of.len() as u32);
        site_of.extend(std::iter::repeat_n(site, outputs));
    }
    first_slot.push(site_of.len() as u32);

    let mut wiring = Checker {
        file,
        names: &names,
        inputs: &inputs,
        first_slot: &first_slot,
        problems,
        guesses: 100,
    };
    let mut wires = Vec::new();
    let mut first_wire = vec![0; inputs.len() + 1];
    for (node, spec) in file.nodes.iter().zip(&names.specs) {
        let start = wires.len();
        wiring.wires_into(node, spec.as_deref(), &mut wires);
        wires[start..].sort_by_key(|wire: &Wire| wire.port);
        first_wire.push(wires.len() as u32);
    }
    let outputs: Vec<_> = file
        .outputs
        .iter()
        .filter_map(|(name, source)| {
            let slot = wiring.resolve(source)?;
            if matches!(inputs.get(slot as usize), Some(Some(input)) if input.optional) {
                wiring.problems.push(
                    Problem::error(
                        "optional-output",
                        format!(
                            "the output `{}` must be there whenever it is asked for, but the input `{}` is optional",
                            name.value, source.value
                        ),
                        source.span,
                        "may be absent",
                    )
                    .help("make the input required, or put out something that is always there"),
                );
            }
            Some(GraphOutput {
                name: name.value.clone(),
                slot,
            })
        })
        .collect();

    let snapshots: Vec<_> = file
        .snapshots
        .iter()
        .filter_map(|snapshot| {
            Some(GraphSnapshot {
                name: snapshot.name.value.clone(),
                slot: wiring.resolve(&snapshot.port)?,
                norm: snapshot.norm,
                tolerance: snapshot.tolerance,
                size: snapshot.size,
            })
        })
        .collect();

    let order = order(file, &site_of, &wires, &first_wire, problems);
    let complete = outputs.len() == file.outputs.len() && !outputs.is_empty();
    let inputs = inputs.into_iter().collect::<Option<Vec<_>>>()?;
    let nodes = nodes.into_iter().collect::<Option<Vec<_>>>()?;
    let (readers, first_reader) = readers(site_of.len(), &wires, &first_wire);
    let graph = Graph {
        name: name.to_string(),
        inputs,
        nodes,
        outputs,
        snapshots,
        first_slot,
        site_of,
        wires,
        first_wire,
        readers,
        first_reader,
        order: order?,
        files: Vec::new(),
        warnings: super::Mistakes::default(),
    };
    // A wire that is wrong leaves its source unused; to say so would be noise.
    if complete && problems.iter().all(|problem| problem.severity != Severity::Error) {
        unused(&graph, file, problems);
    }
    Some(graph)
}

/// Later entries of the same name win; the repetition was reported.
fn numbered<'f>(names: impl Iterator<Item = &'f Spanned<String>>) -> HashMap<&'f str, u32> {
    names
        .enumerate()
        .map(|(i, name)| (name.value.as_str(), i as u32))
        .collect()
}

fn find_type(node: &FileNode<'_>, registry: &Registry, problems: &mut Vec<Problem>) -> Option<Arc<NodeSpec>> {
    let name = node.node.as_ref()?;
    if let Some(node_type) = registry.find_node(name.value) {
        return Some(Arc::clone(&node_type.spec));
    }
    problems.push(
        Problem::error(
            "unknown-node-type",
            format!("there is no node type `{}`", name.value),
            name.span,
            "unknown type",
        )
        .help(match nearest(name.value, registry.nodes().map(|node| node.spec.name)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`gear nodes` lists the types".to_string(),
        }),
    );
    None
}

fn read_input(input: &FileInput<'_>, registry: &Registry, problems: &mut Vec<Problem>) -> Option<GraphInput> {
    let type_name = input.type_name.as_ref()?;
    let Some(value_type) = registry.find_value(type_name.value) else {
        let types: Vec<_> = registry.values().map(|value_type| value_type.name).collect();
        problems.push(
            Problem::error(
                "unknown-value-type",
                format!("there is no type of values `{}`", type_name.value),
                type_name.span,
                "unknown type",
            )
            .help(match nearest(type_name.value, types.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the types are {}", types.join(", ")),
            }),
        );
        return None;
    };
    let what = format!("input `{}` ({})", input.name.value, value_type.name);
    let mut load = None;
    let loader = registry.find_loader(value_type.name);
    match loader {
        Some(loader) => {
            let mut fields = Fields::new(input.with, input.name.span, &what, problems)?;
            let read = (loader.read)(&mut fields)?;
            report_check(read.check(), &what, input.with, input.name.span, problems)?;
            load = Some(read);
        }
        // No loader takes no parameters: every one of them is unknown.
        None => Fields::new(input.with, input.name.span, &what, problems)?.finish(),
    }
    Some(GraphInput {
        name: input.name.value.clone(),
        value_type,
        optional: input.optional,
        loader: loader.map(|loader| Arc::clone(&loader.spec)),
        load,
    })
}

fn read_node(
    node: &FileNode<'_>,
    spec: &Arc<NodeSpec>,
    registry: &Registry,
    problems: &mut Vec<Problem>,
) -> Option<GraphNode> {
    let what = format!("node `{}` ({})", node.id.value, spec.name);
    let mut fields = Fields::new(node.with, node.id.span, &what, problems)?;
    let read = (registry.find_node(spec.name)?.read)(&mut fields)?;
    report_check(read.check(), &what, node.with, node.id.span, problems)?;
    Some(GraphNode {
        id: node.id.value.clone(),
        spec: Arc::clone(spec),
        node: read,
    })
}

/// Reports parameters that an overlay removes although nothing has such parameters.
pub fn unset(unset: &[Unset], file: &File<'_>, registry: &Registry, problems: &mut Vec<Problem>) {
    for Unset { site, within, param } in unset {
        let node = file.nodes.iter().find(|node| node.id.value == *site);
        let node_type = node.and_then(|node| registry.find_node(node.node.as_ref()?.value));
        let input = file.inputs.iter().find(|input| input.name.value == *site);
        let type_name = input.and_then(|input| input.type_name.as_ref());
        let (mut what, mut specs): (String, &[ParamSpec]) = match (node_type, type_name) {
            (Some(node), _) => (format!("node `{site}` ({})", node.spec.name), &node.spec.params),
            (None, Some(value_type)) if node.is_none() => (
                format!("input `{site}` ({})", value_type.value),
                match registry.find_loader(value_type.value) {
                    Some(loader) => &loader.spec.params,
                    None => &[],
                },
            ),
            _ => continue, // its type is unknown, which is reported, or a later overlay removed it
        };
        let mut is_known = true;
        for (name, method) in within {
            let spec = specs.iter().find(|spec| spec.name == *name);
            match spec.and_then(|spec| spec.kind.method(method)) {
                Some(params) => specs = params,
                // Reported when the parameters are read, or no method but a map.
                None => is_known = false,
            }
            what = format!("`{method}` of parameter `{name}` of {what}");
        }
        let known: Vec<_> = specs.iter().map(|param| param.name).collect();
        if is_known && !known.contains(&param.value.as_str()) {
            problems.push(unknown_parameter(&what, param, &known));
        }
    }
}

/// Reports inputs that cannot be given as files.
pub fn not_from_files(file: &File<'_>, registry: &Registry, problems: &mut Vec<Problem>) {
    for input in &file.inputs {
        let Some(type_name) = &input.type_name else { continue };
        if registry.find_value(type_name.value).is_none() || registry.find_loader(type_name.value).is_some() {
            continue;
        }
        let message = format!(
            "the input `{}` can never be given: no loader reads files of type {}",
            input.name.value, type_name.value
        );
        let readable: Vec<_> = registry.loaders().map(|loader| loader.spec.value_type.name).collect();
        let label = "not read from files";
        let problem = if input.optional {
            Problem::warning("no-loader", message, type_name.span, label)
        } else {
            Problem::error("no-loader", message, type_name.span, label)
        };
        problems.push(problem.help(match readable.as_slice() {
            [] => "compute it by a node".to_owned(),
            types => format!("compute it by a node; files are read of type {}", types.join(", ")),
        }));
    }
}

/// Points at the parameter that `check` names, if it is written in the file.
fn report_check(
    result: Result<(), NodeError>,
    what: &str,
    with: Option<&Tree>,
    span: Span,
    problems: &mut Vec<Problem>,
) -> Option<()> {
    let Err(error) = result else { return Some(()) };
    let (message, span) = match &error {
        NodeError::Param { param, problem } => {
            let written = match with.map(|tree| &tree.kind) {
                Some(TreeKind::Map(entries)) => entries.iter().rev().find(|(key, _)| key.value == *param),
                _ => None,
            };
            (
                format!("parameter `{param}` of {what}: {problem}"),
                written.map_or(span, |(_, value)| value.span),
            )
        }
        other => (format!("{what}: {other}"), span),
    };
    problems.push(Problem::error("parameters-do-not-fit", message, span, "does not fit"));
    None
}

/// Warns of nodes and inputs that no output and no snapshot needs.
fn unused(graph: &Graph, file: &File<'_>, problems: &mut Vec<Problem>) {
    let mut used = vec![false; graph.sites()];
    let mut stack: Vec<u32> = graph
        .outputs
        .iter()
        .map(|output| output.slot)
        .chain(graph.snapshots.iter().map(|snapshot| snapshot.slot))
        .map(|slot| graph.site_of[slot as usize])
        .collect();
    while let Some(site) = stack.pop() {
        if !std::mem::replace(&mut used[site as usize], true) {
            stack.extend(
                graph
                    .wires_of(site)
                    .iter()
                    .map(|wire| graph.site_of[wire.from as usize]),
            );
        }
    }
    let places = file
        .inputs
        .iter()
        .map(|input| ("unused-input", "input", input.name))
        .chain(file.nodes.iter().map(|node| ("unused-node", "node", node.id)));
    for ((code, what, name), used) in places.zip(used) {
        if !used {
            problems.push(
                Problem::warning(
                    code,
                    format!("no output needs the {what} `{}`", name.value),
                    name.span,
                    "never used",
                )
                .help(if name.span.source == 0 {
                    "remove it, or make one of the `outputs` depend on it".to_owned()
                } else {
                    format!(
                        "`{}: null` removes it; or make one of the `outputs` depend on it",
                        name.value
                    )
                }),
            );
        }
    }
}
