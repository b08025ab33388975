//! Graph files: read with positions, checked completely before anything runs.
//!
//! ```yaml
//! gear: 1
//! inputs:
//!   painting: {type: Image, with: {size: 768}}   # or just `painting: Image`
//! nodes:
//!   edges: {node: EdgeDetect, in: {image: painting}}
//!   ratio: {node: LogRatio,   in: {image: painting}, with: {radius: 0.03}}
//! outputs:
//!   ratio: ratio.ratio
//! ```
//!
//! A bare name is a graph input, `node.port` an output of a node; a port that takes many values is given a list.
//! Reading goes text → [`Tree`] (`yaml`), for the file and those that it extends (`chain`), laid over each
//! other (`overlay`), changed by overrides (`set`) → names with positions (`file`) → [`Graph`] (`check`). All of them
//! report every mistake they find.

mod causes;
mod chain;
mod check;
mod compiled;
mod declaration;
mod excerpt;
mod export;
mod file;
mod library;
mod mistakes;
mod overlay;
mod plain;
mod print;
mod schema;
mod set;
mod snapshots;
mod suggest;
mod yaml;

use std::sync::Arc;

pub use causes::{CAUSES, Cause};
pub use declaration::read_declaration;
pub use library::{GraphFile, Library, Unreadable};
pub use mistakes::{Mistakes, Source};
pub use schema::schema;
pub use snapshots::{GraphSnapshot, Norm};
pub(crate) use suggest::glued;
pub use suggest::nearest;

use crate::registry::{AnyLoader, AnyNode};
use crate::{LoaderSpec, NodeSpec, ParamValues, Problem, Registry, Store, Tree, ValueType};

/// Reads YAML with the place of everything in it, as graph files are read, for other files that people write. What is
/// wrong with it, keys that repeat included, points into source number `source`.
pub fn read_yaml(text: &str, source: u32, problems: &mut Vec<Problem>) -> Option<Tree> {
    let tree = yaml::parse(text, source, problems)?;
    yaml::duplicate_keys(&tree, problems);
    Some(tree)
}

/// The version of graph files that is read.
pub const GRAPH_VERSION: i64 = 1;

/// A checked graph. Inputs and nodes are *sites*: inputs first, then nodes, each in the order of the file. Every
/// output port of a site is a *slot*; the executor works on slot numbers only.
pub struct Graph {
    pub(crate) name: String,
    pub(crate) inputs: Vec<GraphInput>,
    pub(crate) nodes: Vec<GraphNode>,
    pub(crate) outputs: Vec<GraphOutput>,
    pub(crate) snapshots: Vec<GraphSnapshot>,
    /// First slot of every site, and the number of slots at the end.
    pub(crate) first_slot: Vec<u32>,
    /// Site of every slot.
    pub(crate) site_of: Vec<u32>,
    /// Wires into every site, sorted by port: `wires[first_wire[site]..first_wire[site + 1]]`.
    pub(crate) wires: Vec<Wire>,
    pub(crate) first_wire: Vec<u32>,
    /// Wires out of every slot.
    pub(crate) readers: Vec<Reading>,
    pub(crate) first_reader: Vec<u32>,
    /// All sites, producers before consumers.
    pub(crate) order: Vec<u32>,
    pub(crate) files: Vec<GraphFile>,
    pub(crate) warnings: Mistakes,
}

/// What one end of a wire into a site says: which of its input ports, from which slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wire {
    pub port: u16,
    pub from: u32,
}

/// What one end of a wire out of a slot says: which port of which site reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reading {
    pub site: u32,
    pub port: u16,
}

/// An input of a graph.
pub struct GraphInput {
    /// Its name.
    pub name: String,
    /// Its type.
    pub value_type: ValueType,
    /// Whether a run may go without it.
    pub optional: bool,
    /// Its loader, if the type has one.
    pub loader: Option<Arc<LoaderSpec>>,
    pub(crate) load: Option<Arc<dyn AnyLoader>>,
}

/// A node of a graph.
pub struct GraphNode {
    /// Its id.
    pub id: String,
    /// Its type.
    pub spec: Arc<NodeSpec>,
    pub(crate) node: Arc<dyn AnyNode>,
}

/// An output of a graph.
pub struct GraphOutput {
    /// Its name.
    pub name: String,
    pub(crate) slot: u32,
}

/// What is checked into a [`Graph`]: the text, its name in messages, and overrides.
#[derive(Clone, Debug, Default)]
pub struct GraphSource {
    /// The file's name, as the user gave it.
    pub name: String,
    /// Its content.
    pub text: String,
    /// Overrides, each `NODE.PARAM=VALUE` or `INPUT.PARAM=VALUE` (the value is YAML), later ones win.
    pub set: Vec<String>,
    /// Where the graphs are found that it extends.
    pub library: Library,
}

/// How the inputs of a graph will be given.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Given {
    /// As values or as files, by a program.
    Values,
    /// As files only.
    Files,
}

impl GraphSource {
    /// A graph file without overrides. What it extends is found on disk only.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
            ..Self::default()
        }
    }

    /// The graph file `name` of a library: `@NAME`, or a path.
    pub fn open(name: impl Into<String>, library: &Library) -> Result<Self, Unreadable> {
        let name = name.into();
        Ok(Self {
            text: library.read(&name)?.into_owned(),
            name,
            set: Vec::new(),
            library: library.clone(),
        })
    }

    /// Adds an override.
    pub fn set(mut self, set: impl Into<String>) -> Self {
        self.set.push(set.into());
        self
    }

    /// Reads and checks everything; all mistakes at once.
    pub fn check(&self, registry: &Registry) -> Result<Graph, Mistakes> {
        self.read(registry, None, Given::Values).map(|(graph, _)| graph)
    }

    /// The same for who gives inputs as files only, as `gear` does: an input that no loader reads is a mistake then.
    pub fn check_for_files(&self, registry: &Registry) -> Result<Graph, Mistakes> {
        self.read(registry, None, Given::Files).map(|(graph, _)| graph)
    }

    /// The same, but what checked clean before is taken from the store.
    pub fn check_in(&self, registry: &Registry, store: &Store) -> Result<Graph, Mistakes> {
        match compiled::find(self, registry, store) {
            Some(graph) => Ok(graph),
            None => self.read(registry, Some(store), Given::Values).map(|(graph, _)| graph),
        }
    }

    /// The text of one file that is the same graph: what it extends and the overrides are in it.
    pub fn resolve(&self, registry: &Registry) -> Result<String, Mistakes> {
        self.read(registry, None, Given::Values)
            .map(|(_, tree)| print::graph(&tree))
    }

    fn read(&self, registry: &Registry, store: Option<&Store>, given: Given) -> Result<(Graph, Tree), Mistakes> {
        let mut sources = Vec::new();
        let mut problems = Vec::new();
        let mut compiled = None;
        let read = chain::read(self, &mut sources, &mut problems).and_then(|chain| {
            let laid = overlay::lay(chain.trees, &mut problems)?;
            let tree = set::apply(laid.tree, &self.set, &mut sources, &mut problems);
            let file = file::read(&tree, &laid.removed, &mut problems)?;
            check::unset(&laid.unset, &file, registry, &mut problems);
            if given == Given::Files {
                check::not_from_files(&file, registry, &mut problems);
            }
            let mut graph = check::check(&self.name, &file, registry, &mut problems)?;
            if store.is_some() && problems.is_empty() {
                compiled = Some(compiled::write(&file, &graph, &chain.files[1..]));
            }
            graph.files = chain.files;
            Some((graph, tree))
        });
        let mistakes = Mistakes::new(sources, problems);
        match read {
            Some((mut graph, tree)) if !mistakes.has_errors() => {
                if let (Some(store), Some(bytes)) = (store, compiled) {
                    compiled::keep(self, registry, store, &bytes);
                }
                graph.warnings = mistakes;
                Ok((graph, tree))
            }
            _ => Err(mistakes),
        }
    }
}

impl Graph {
    /// The file's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The files it was read from: the graph file itself first, then what it extends, to the base of all.
    pub fn files(&self) -> &[GraphFile] {
        &self.files
    }

    /// What is odd but can run, such as nodes that no output needs.
    pub fn warnings(&self) -> &Mistakes {
        &self.warnings
    }

    /// The inputs, in the order of the file.
    pub fn inputs(&self) -> &[GraphInput] {
        &self.inputs
    }

    /// The nodes, in the order of the file.
    pub fn nodes(&self) -> &[GraphNode] {
        &self.nodes
    }

    /// The outputs, in the order of the file.
    pub fn outputs(&self) -> &[GraphOutput] {
        &self.outputs
    }

    /// The `node.port` or the input that an output is.
    pub fn output_source(&self, output: &GraphOutput) -> String {
        self.slot_name(output.slot)
    }

    /// The type of an output.
    pub fn output_type(&self, output: &GraphOutput) -> ValueType {
        self.slot_type(output.slot)
    }

    /// The ports that are pinned, in the order of the file.
    pub fn snapshots(&self) -> &[GraphSnapshot] {
        &self.snapshots
    }

    /// The `node.port` or the input that a snapshot is of.
    pub fn snapshot_source(&self, snapshot: &GraphSnapshot) -> String {
        self.slot_name(snapshot.slot)
    }

    /// The type of the value that a snapshot is of.
    pub fn snapshot_type(&self, snapshot: &GraphSnapshot) -> ValueType {
        self.slot_type(snapshot.slot)
    }

    /// The same graph with its snapshots, by their names, in place of its outputs. Keys do not change: they are those of
    /// ports, and the ports are the same.
    pub fn into_snapshots(self) -> Self {
        let output = |snapshot: &GraphSnapshot| GraphOutput {
            name: snapshot.name.clone(),
            slot: snapshot.slot,
        };
        Self {
            outputs: self.snapshots.iter().map(output).collect(),
            ..self
        }
    }

    /// What is wired to the input ports of a node: port and source (`node.port` or an input's name), by port.
    pub fn wiring(&self, node: usize) -> Vec<(&'static str, String)> {
        let site = self.inputs.len() + node;
        self.wires_of(site as u32)
            .iter()
            .map(|wire| {
                (
                    self.nodes[node].spec.inputs[usize::from(wire.port)].name,
                    self.slot_name(wire.from),
                )
            })
            .collect()
    }

    pub(crate) fn sites(&self) -> usize {
        self.inputs.len() + self.nodes.len()
    }

    pub(crate) fn slots(&self) -> usize {
        self.site_of.len()
    }

    /// The node of a site, if the site is no input.
    pub(crate) fn node_at(&self, site: u32) -> Option<&GraphNode> {
        (site as usize)
            .checked_sub(self.inputs.len())
            .map(|node| &self.nodes[node])
    }

    pub(crate) fn site_name(&self, site: u32) -> &str {
        match self.node_at(site) {
            Some(node) => &node.id,
            None => &self.inputs[site as usize].name,
        }
    }

    pub(crate) fn slots_of(&self, site: u32) -> std::ops::Range<u32> {
        self.first_slot[site as usize]..self.first_slot[site as usize + 1]
    }

    pub(crate) fn wires_of(&self, site: u32) -> &[Wire] {
        let site = site as usize;
        &self.wires[self.first_wire[site] as usize..self.first_wire[site + 1] as usize]
    }

    pub(crate) fn readers_of(&self, slot: u32) -> &[Reading] {
        let slot = slot as usize;
        &self.readers[self.first_reader[slot] as usize..self.first_reader[slot + 1] as usize]
    }

    /// The output port of its site that a slot is.
    pub(crate) fn port_of(&self, slot: u32) -> usize {
        (slot - self.first_slot[self.site_of[slot as usize] as usize]) as usize
    }

    pub(crate) fn slot_name(&self, slot: u32) -> String {
        let site = self.site_of[slot as usize];
        match self.node_at(site) {
            Some(node) => format!("{}.{}", node.id, node.spec.outputs[self.port_of(slot)].name),
            None => self.inputs[site as usize].name.clone(),
        }
    }

    /// The name of the slot's port alone; the input's name for an input.
    pub(crate) fn port_name(&self, slot: u32) -> &str {
        let site = self.site_of[slot as usize];
        match self.node_at(site) {
            Some(node) => node.spec.outputs[self.port_of(slot)].name,
            None => &self.inputs[site as usize].name,
        }
    }

    pub(crate) fn slot_type(&self, slot: u32) -> ValueType {
        let site = self.site_of[slot as usize];
        match self.node_at(site) {
            Some(node) => node.spec.outputs[self.port_of(slot)].value_type,
            None => self.inputs[site as usize].value_type,
        }
    }
}

impl GraphNode {
    /// The parameters, defaults filled in.
    pub fn params(&self) -> ParamValues {
        self.node.params()
    }
}

impl GraphInput {
    /// The parameters of its loader, defaults filled in.
    pub fn params(&self) -> ParamValues {
        self.load.as_ref().map(|load| load.params()).unwrap_or_default()
    }
}

impl std::fmt::Debug for Graph {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "Graph({}, {} inputs, {} nodes)",
            self.name,
            self.inputs.len(),
            self.nodes.len()
        )
    }
}

#[cfg(test)]
mod tests;
