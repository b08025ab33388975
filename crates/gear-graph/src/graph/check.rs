//! Names, types, wires and parameters → [`Graph`].
//!
//! Nothing here stops at the first mistake: a name that is not found costs only what hangs on it.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::sync::Arc;

use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

use super::file::{File, FileInput, FileNode, Wiring};
use super::{Graph, GraphInput, GraphNode, GraphOutput, Reading, Wire, nearest};
use crate::{Fields, NodeError, NodeSpec, Problem, Registry, Severity, Span, Spanned, Tree, TreeKind};

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
            Some(GraphOutput {
                name: name.value.clone(),
                slot,
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
        first_slot,
        site_of,
        wires,
        first_wire,
        readers,
        first_reader,
        order: order?,
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

/// Resolves references and checks the wires.
struct Checker<'c, 'f> {
    file: &'c File<'f>,
    names: &'c Names<'f>,
    inputs: &'c [Option<GraphInput>],
    first_slot: &'c [u32],
    problems: &'c mut Vec<Problem>,
}

impl Checker<'_, '_> {
    fn wires_into(&mut self, node: &FileNode<'_>, spec: Option<&NodeSpec>, wires: &mut Vec<Wire>) {
        let mut given = 0u64;
        for (key, wiring) in &node.inputs {
            let port = spec.map(|spec| spec.inputs.iter().position(|port| port.name == key.value));
            if let (Some(None), Some(spec)) = (port, spec) {
                let names = spec.inputs.iter().map(|port| port.name);
                let help = match nearest(&key.value, names.clone()) {
                    Some(name) => format!("did you mean `{name}`?"),
                    None if spec.inputs.is_empty() => "it has no input ports".to_string(),
                    None => format!("its input ports are {}", names.collect::<Vec<_>>().join(", ")),
                };
                self.problems.push(
                    Problem::error(
                        "unknown-port",
                        format!(
                            "node `{}` ({}) has no input port `{}`",
                            node.id.value, spec.name, key.value
                        ),
                        key.span,
                        "unknown port",
                    )
                    .help(help),
                );
            }
            // References are resolved also where the port is unknown, to report all that is wrong with them.
            for source in &wiring.refs {
                let slot = self.resolve(source);
                let (Some(spec), Some(Some(port))) = (spec, port) else {
                    continue;
                };
                given |= 1 << port;
                if let Some(slot) = slot
                    && self.fits(node, spec, port, source, slot, wiring)
                {
                    wires.push(Wire {
                        port: port as u16,
                        from: slot,
                    });
                }
            }
        }
        for (i, port) in spec.map(|spec| &spec.inputs[..]).unwrap_or_default().iter().enumerate() {
            if !port.optional && given & (1 << i) == 0 {
                self.problems.push(
                    Problem::error(
                        "missing-input",
                        format!(
                            "nothing is wired to the port `{}` of node `{}`, which needs a {}",
                            port.name, node.id.value, port.value_type.name
                        ),
                        node.id.span,
                        format!("`{}` is missing", port.name),
                    )
                    .help(format!("add `{}: …` to its `in`: {}", port.name, first_line(port.doc))),
                );
            }
        }
    }

    /// Whether a source may be wired to a port; reports why not.
    fn fits(
        &mut self,
        node: &FileNode<'_>,
        spec: &NodeSpec,
        port: usize,
        source: &Spanned<&str>,
        slot: u32,
        wiring: &Wiring<'_>,
    ) -> bool {
        let port = &spec.inputs[port];
        let what = format!("port `{}` of node `{}`", port.name, node.id.value);
        if wiring.list && !port.many {
            self.problems.push(Problem::error(
                "wrong-type",
                format!("{what} takes one {}, found a list", port.value_type.name),
                source.span,
                "expected one source",
            ));
            return false;
        }
        let (found, optional) = match self.inputs.get(slot as usize) {
            // Inputs have one slot each, and come first.
            Some(Some(input)) => (input.value_type, input.optional),
            Some(None) => return false, // its type is unknown, and reported
            None => {
                let site = self.first_slot.partition_point(|first| *first <= slot) - 1;
                let Some(from) = &self.names.specs[site - self.inputs.len()] else {
                    return false;
                };
                (from.outputs[(slot - self.first_slot[site]) as usize].value_type, false)
            }
        };
        if found != port.value_type {
            self.problems.push(
                Problem::error(
                    "wrong-port-type",
                    format!(
                        "{what} takes a {}, but `{}` is a {}",
                        port.value_type.name, source.value, found.name
                    ),
                    source.span,
                    format!("expected {}, found {}", port.value_type.name, found.name),
                )
                .maybe_help(self.sources_of(port.value_type.name)),
            );
            return false;
        }
        if optional && !port.optional {
            self.problems.push(
                Problem::error(
                    "optional-into-required",
                    format!("{what} needs a value, but the input `{}` is optional", source.value),
                    source.span,
                    "may be absent",
                )
                .help("make the input required, or wire something that is always there"),
            );
            return false;
        }
        true
    }

    /// Some sources in the file that have the type, for help.
    fn sources_of(&self, type_name: &str) -> Option<String> {
        let inputs = self
            .inputs
            .iter()
            .flatten()
            .filter(|input| input.value_type.name == type_name)
            .map(|input| input.name.clone());
        let ports = self.file.nodes.iter().zip(&self.names.specs).flat_map(|(node, spec)| {
            spec.iter()
                .flat_map(|spec| spec.outputs.iter())
                .filter(|port| port.value_type.name == type_name)
                .map(|port| format!("{}.{}", node.id.value, port.name))
        });
        let some: Vec<_> = inputs.chain(ports).take(4).collect();
        (!some.is_empty()).then(|| format!("of type {type_name} are {}", some.join(", ")))
    }

    /// The slot that a reference means; reports why there is none. `None` without a report if the node's type is
    /// unknown, which was reported.
    fn resolve(&mut self, source: &Spanned<&str>) -> Option<u32> {
        let Some((id, port)) = source.value.split_once('.') else {
            if let Some(input) = self.names.inputs.get(source.value) {
                return Some(*input);
            }
            self.unknown_source(source);
            return None;
        };
        let Some(node) = self.names.nodes.get(id) else {
            self.unknown_source(source);
            return None;
        };
        let spec = self.names.specs[*node as usize].as_ref()?;
        if let Some(i) = spec.outputs.iter().position(|output| output.name == port) {
            return Some(self.first_slot[self.inputs.len() + *node as usize] + i as u32);
        }
        let names = spec.outputs.iter().map(|output| output.name);
        let help = match nearest(port, names.clone()) {
            Some(name) => format!("did you mean `{id}.{name}`?"),
            None => format!("its outputs are {}", names.collect::<Vec<_>>().join(", ")),
        };
        self.problems.push(
            Problem::error(
                "unknown-port",
                format!("node `{id}` ({}) has no output `{port}`", spec.name),
                source.span,
                "unknown output",
            )
            .help(help),
        );
        None
    }

    fn unknown_source(&mut self, source: &Spanned<&str>) {
        let (name, port) = match source.value.split_once('.') {
            Some((id, port)) => (id, Some(port)),
            None => (source.value, None),
        };
        let outputs_of = |id: &str| -> Vec<String> {
            let spec = self
                .names
                .nodes
                .get(id)
                .and_then(|i| self.names.specs[*i as usize].as_ref());
            spec.iter()
                .flat_map(|spec| spec.outputs.iter())
                .map(|output| format!("{id}.{}", output.name))
                .collect()
        };
        let (message, help) = match port {
            None if self.names.nodes.contains_key(name) => (
                format!("`{name}` is a node, not one of its outputs"),
                Some(format!("write {}", outputs_of(name).join(" or "))),
            ),
            None => {
                let near = nearest(
                    name,
                    self.names
                        .inputs
                        .keys()
                        .copied()
                        .chain(self.names.nodes.keys().copied()),
                );
                let help = near.map(|near| match outputs_of(near).first() {
                    Some(output) => format!("did you mean `{output}`?"),
                    None => format!("did you mean `{near}`?"),
                });
                (format!("there is no input `{name}`"), help)
            }
            Some(_) if self.names.inputs.contains_key(name) => (
                format!("`{name}` is an input; an input has no ports"),
                Some(format!("write `{name}`")),
            ),
            Some(port) => {
                let near = nearest(name, self.names.nodes.keys().copied());
                (
                    format!("there is no node `{name}`"),
                    near.map(|near| format!("did you mean `{near}.{port}`?")),
                )
            }
        };
        self.problems
            .push(Problem::error("unknown-source", message, source.span, "unknown source").maybe_help(help));
    }
}

fn first_line(doc: &str) -> &str {
    doc.lines().next().unwrap_or_default()
}

/// All sites in an order of work that keeps to the order of the file where it can, or the loops that prevent one.
fn order(
    file: &File<'_>,
    site_of: &[u32],
    wires: &[Wire],
    first_wire: &[u32],
    problems: &mut Vec<Problem>,
) -> Option<Vec<u32>> {
    let sites = first_wire.len() - 1;
    let mut dag = DiGraph::<(), ()>::with_capacity(sites, wires.len());
    let mut waits = vec![0u32; sites];
    for _ in 0..sites {
        dag.add_node(());
    }
    for (site, waits) in waits.iter_mut().enumerate() {
        for wire in &wires[first_wire[site] as usize..first_wire[site + 1] as usize] {
            let from = site_of[wire.from as usize] as usize;
            dag.add_edge(NodeIndex::new(from), NodeIndex::new(site), ());
            *waits += 1;
        }
    }
    // Kahn's algorithm, first of the file first.
    let mut free: BinaryHeap<Reverse<u32>> = (0..sites as u32)
        .filter(|site| waits[*site as usize] == 0)
        .map(Reverse)
        .collect();
    let mut order = Vec::with_capacity(sites);
    while let Some(Reverse(site)) = free.pop() {
        order.push(site);
        for reader in dag.neighbors(NodeIndex::new(site as usize)) {
            waits[reader.index()] -= 1;
            if waits[reader.index()] == 0 {
                free.push(Reverse(reader.index() as u32));
            }
        }
    }
    if order.len() == sites {
        return Some(order);
    }
    // `kosaraju_scc` does not recurse; `tarjan_scc` does, and overflows at 100,000 nodes.
    for component in kosaraju_scc(&dag) {
        let looped = component.len() > 1 || dag.contains_edge(component[0], component[0]);
        if looped {
            problems.push(cycle(file, &dag, &component));
        }
    }
    None
}

/// The shortest loop through the first node (by place in the file) of a strongly connected component.
fn cycle(file: &File<'_>, dag: &DiGraph<(), ()>, component: &[NodeIndex]) -> Problem {
    let members: std::collections::BTreeSet<_> = component.iter().copied().collect();
    let start = *members.first().expect("a component has members");
    // Breadth first from the start until it is reached again; `before` remembers the way.
    let mut before = HashMap::new();
    let mut queue = std::collections::VecDeque::from([start]);
    'search: while let Some(at) = queue.pop_front() {
        let mut next: Vec<_> = dag.neighbors(at).filter(|n| members.contains(n)).collect();
        next.sort_unstable();
        for to in next {
            if to == start {
                before.insert(start, at);
                break 'search;
            }
            if let std::collections::hash_map::Entry::Vacant(entry) = before.entry(to) {
                entry.insert(at);
                queue.push_back(to);
            }
        }
    }
    let mut path = vec![start];
    while let Some(at) = before.get(path.last().expect("never empty")) {
        if *at == start {
            break;
        }
        path.push(*at);
    }
    path[1..].reverse();
    // Only nodes can be in a loop: inputs have no wires into them.
    let id = |site: &NodeIndex| file.nodes[site.index() - file.inputs.len()].id;
    let mut names: Vec<_> = path.iter().map(|site| id(site).value.as_str()).collect();
    names.push(names[0]);
    let mut problem = Problem::error(
        "cycle",
        format!("these nodes wait for each other: {}", names.join(" → ")),
        id(&path[0]).span,
        "the loop begins here",
    )
    .help("a node cannot depend on its own result; remove one of these wires");
    for (i, site) in path.iter().enumerate().skip(1).take(9) {
        problem = problem.label(id(site).span, format!("reads `{}`", names[i - 1]));
    }
    problem
}

/// The wires out of every slot, in the order of the sites that read it.
fn readers(slots: usize, wires: &[Wire], first_wire: &[u32]) -> (Vec<Reading>, Vec<u32>) {
    let mut first = vec![0u32; slots + 1];
    for wire in wires {
        first[wire.from as usize + 1] += 1;
    }
    for i in 0..slots {
        first[i + 1] += first[i];
    }
    let mut at = first.clone();
    let mut readers = vec![Reading { site: 0, port: 0 }; wires.len()];
    for site in 0..first_wire.len() - 1 {
        for wire in &wires[first_wire[site] as usize..first_wire[site + 1] as usize] {
            let place = &mut at[wire.from as usize];
            readers[*place as usize] = Reading {
                site: site as u32,
                port: wire.port,
            };
            *place += 1;
        }
    }
    (readers, first)
}

/// Warns of nodes and inputs that no output needs.
fn unused(graph: &Graph, file: &File<'_>, problems: &mut Vec<Problem>) {
    let mut used = vec![false; graph.sites()];
    let mut stack: Vec<u32> = graph
        .outputs
        .iter()
        .map(|output| graph.site_of[output.slot as usize])
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
                .help("remove it, or make one of the `outputs` depend on it"),
            );
        }
    }
}
