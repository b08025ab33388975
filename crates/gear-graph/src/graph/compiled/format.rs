//! The bytes of a checked graph.
//!
//! Numbers are written in groups of seven bits, least first; texts and lists begin with their length.
//!
//! ```text
//! files    name, digest                              what the graph extends
//! types    names of node types                       numbered from 0
//! inputs   name, type, optional, parameters
//! nodes    id, type, parameters, wires: port, slot   the slot as its distance from the node's first
//! outputs  name, slot
//! snapshots  name, slot, norm, bits of the tolerance, size
//! order    0 if sites stand in an order of work, else 1 and the sites
//! ```

use std::sync::Arc;

use super::File;
use crate::graph::check::readers;
use crate::graph::{Graph, GraphFile, GraphInput, GraphNode, GraphOutput, GraphSnapshot, Norm, Wire};
use crate::registry::AnyNode;
use crate::{Digest, Fields, NodeType, Registry, Span, Spanned, Tree, TreeKind};

/// Raised when the format changes, or what a graph file means.
pub const VERSION: u64 = 2;

/// A file and the graph that was made of it.
pub fn write(file: &File<'_>, graph: &Graph, extends: &[GraphFile]) -> Vec<u8> {
    let mut w = Writer(Vec::with_capacity(64 * graph.nodes.len()));
    w.number(extends.len());
    for file in extends {
        w.text(&file.name);
        w.0.extend(file.digest.0);
    }
    let mut types: Vec<&str> = graph.nodes.iter().map(|node| node.spec.name).collect();
    types.sort_unstable();
    types.dedup();
    w.number(types.len());
    for name in &types {
        w.text(name);
    }
    w.number(graph.inputs.len());
    for (input, written) in graph.inputs.iter().zip(&file.inputs) {
        w.text(&input.name);
        w.text(input.value_type.name);
        w.number(usize::from(input.optional));
        w.maybe_tree(written.with);
    }
    w.number(graph.nodes.len());
    for (i, (node, written)) in graph.nodes.iter().zip(&file.nodes).enumerate() {
        let site = graph.inputs.len() + i;
        w.text(&node.id);
        w.number(types.binary_search(&node.spec.name).unwrap_or_default());
        w.maybe_tree(written.with);
        let wires = graph.wires_of(site as u32);
        w.number(wires.len());
        for wire in wires {
            w.number(usize::from(wire.port));
            w.distance(graph.first_slot[site], wire.from);
        }
    }
    w.number(graph.outputs.len());
    for output in &graph.outputs {
        w.text(&output.name);
        w.number(output.slot as usize);
    }
    w.number(graph.snapshots.len());
    for snapshot in &graph.snapshots {
        w.text(&snapshot.name);
        w.number(snapshot.slot as usize);
        w.number(
            Norm::ALL
                .iter()
                .position(|norm| *norm == snapshot.norm)
                .unwrap_or_default(),
        );
        w.0.extend(snapshot.tolerance.to_bits().to_le_bytes());
        w.number(snapshot.size);
    }
    if graph.order.iter().copied().eq(0..graph.sites() as u32) {
        w.number(0);
    } else {
        w.number(1);
        graph.order.iter().for_each(|site| w.number(*site as usize));
    }
    w.0
}

/// The graph; `None` if the bytes are not one, or not one of this registry.
pub fn read(bytes: &[u8], registry: &Registry) -> Option<Graph> {
    let mut r = Reader(bytes);
    let files = r.list(|r| {
        Some(GraphFile {
            name: r.text()?.to_string(),
            digest: Digest(*r.take(32)?.first_chunk()?),
        })
    })?;
    let types: Vec<&NodeType> = r.list(|r| registry.find_node(r.text()?))?;
    let inputs = r.list(|r| read_input(r, registry))?;
    let mut graph = Graph {
        name: String::new(),
        first_slot: (0..inputs.len() as u32).collect(),
        site_of: (0..inputs.len() as u32).collect(),
        first_wire: vec![0; inputs.len() + 1],
        inputs,
        nodes: Vec::new(),
        outputs: Vec::new(),
        snapshots: Vec::new(),
        wires: Vec::new(),
        readers: Vec::new(),
        first_reader: Vec::new(),
        order: Vec::new(),
        files,
        warnings: Default::default(),
    };
    let count = r.count()?;
    graph.nodes.reserve(count);
    let mut last = None;
    for _ in 0..count {
        read_node(&mut r, &types, &mut graph, &mut last)?;
    }
    graph.first_slot.push(graph.site_of.len() as u32);
    let slots = graph.site_of.len();
    let is_slot = |slot: u32| (slot as usize) < slots;
    if !graph.wires.iter().all(|wire| is_slot(wire.from)) {
        return None;
    }
    graph.outputs = r.list(|r| {
        Some(GraphOutput {
            name: r.text()?.to_string(),
            slot: u32::try_from(r.number()?).ok().filter(|slot| is_slot(*slot))?,
        })
    })?;
    graph.snapshots = r.list(|r| {
        Some(GraphSnapshot {
            name: r.text()?.to_string(),
            slot: u32::try_from(r.number()?).ok().filter(|slot| is_slot(*slot))?,
            norm: *Norm::ALL.get(r.number()?)?,
            tolerance: f64::from_bits(u64::from_le_bytes(*r.take(8)?.first_chunk()?)),
            size: r.number()?,
        })
    })?;
    graph.order = match r.number()? {
        0 => (0..graph.sites() as u32).collect(),
        _ => (0..graph.sites())
            .map(|_| u32::try_from(r.number()?).ok())
            .collect::<Option<_>>()?,
    };
    (r.0.is_empty() && is_order(&graph)).then_some(())?;
    (graph.readers, graph.first_reader) = readers(slots, &graph.wires, &graph.first_wire);
    Some(graph)
}

/// Whether `order` holds every site once, producers first.
fn is_order(graph: &Graph) -> bool {
    let mut done = vec![false; graph.sites()];
    graph.order.iter().all(|site| {
        let site = *site as usize;
        site < done.len()
            && !std::mem::replace(&mut done[site], true)
            && graph
                .wires_of(site as u32)
                .iter()
                .all(|wire| done[graph.site_of[wire.from as usize] as usize])
    })
}

fn read_input(r: &mut Reader<'_>, registry: &Registry) -> Option<GraphInput> {
    let name = r.text()?.to_string();
    let value_type = registry.find_value(r.text()?)?;
    let optional = r.number()? == 1;
    let with = r.maybe_tree(0)?;
    let loader = registry.find_loader(value_type.name);
    let load = match loader {
        Some(loader) => {
            let load = with_fields(with.as_ref(), |fields| (loader.read)(fields))?;
            load.check().ok()?;
            Some(load)
        }
        None => None,
    };
    Some(GraphInput {
        name,
        value_type,
        optional,
        loader: loader.map(|loader| Arc::clone(&loader.spec)),
        load,
    })
}

/// The type and the bytes of the parameters of the node before, and what was read from them: nodes that stand side by
/// side are often alike.
type Last<'b> = Option<(usize, &'b [u8], Arc<dyn AnyNode>)>;

fn read_node<'b>(r: &mut Reader<'b>, types: &[&NodeType], graph: &mut Graph, last: &mut Last<'b>) -> Option<()> {
    let id = r.text()?.to_string();
    let number = r.number()?;
    let node_type = types.get(number)?;
    let start = r.0;
    let with = r.maybe_tree(0)?;
    let params = &start[..start.len() - r.0.len()];
    let node = match last {
        Some((of, same, node)) if *of == number && *same == params => Arc::clone(node),
        _ => {
            let node = with_fields(with.as_ref(), |fields| (node_type.read)(fields))?;
            node.check().ok()?;
            *last = Some((number, params, Arc::clone(&node)));
            node
        }
    };
    let site = graph.first_slot.len() as u32;
    let first = graph.site_of.len() as u32;
    graph.first_slot.push(first);
    let spec = &node_type.spec;
    graph.site_of.extend(std::iter::repeat_n(site, spec.outputs.len()));
    let mut before = 0;
    for _ in 0..r.count()? {
        let port = r.number()?;
        // Sorted by port, as whoever reads wires by port relies on.
        if port >= spec.inputs.len() || port < before {
            return None;
        }
        before = port;
        graph.wires.push(Wire {
            port: port as u16,
            from: r.distance(first)?,
        });
    }
    graph.first_wire.push(graph.wires.len() as u32);
    graph.nodes.push(GraphNode {
        id,
        spec: Arc::clone(spec),
        node,
    });
    Some(())
}

fn with_fields<T>(with: Option<&Tree>, read: impl FnOnce(&mut Fields<'_, '_>) -> Option<T>) -> Option<T> {
    let mut problems = Vec::new();
    let result = read(&mut Fields::new(with, Span::default(), "", &mut problems)?);
    result.filter(|_| problems.is_empty())
}

/// Trees in a blob were in a file, and files are not deeper.
const DEEPEST: usize = 80;

struct Writer(Vec<u8>);

impl Writer {
    fn number(&mut self, mut number: usize) {
        while number >= 0x80 {
            self.0.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.0.push(number as u8);
    }

    /// `to` as seen from `from`, small when near: even before it, odd behind it.
    fn distance(&mut self, from: u32, to: u32) {
        let (from, to) = (from as usize, to as usize);
        self.number(if to < from {
            2 * (from - to)
        } else {
            2 * (to - from) + 1
        });
    }

    fn text(&mut self, text: &str) {
        self.number(text.len());
        self.0.extend(text.as_bytes());
    }

    fn maybe_tree(&mut self, tree: Option<&Tree>) {
        match tree {
            None => self.0.push(0),
            Some(tree) => {
                self.0.push(1);
                self.tree(tree);
            }
        }
    }

    fn tree(&mut self, tree: &Tree) {
        match &tree.kind {
            TreeKind::Null => self.0.push(0),
            TreeKind::Bool(value) => self.0.extend([1, u8::from(*value)]),
            TreeKind::Integer(value) => {
                self.0.push(2);
                self.0.extend(value.to_le_bytes());
            }
            TreeKind::Float(value) => {
                self.0.push(3);
                self.0.extend(value.to_bits().to_le_bytes());
            }
            TreeKind::Text(value) => {
                self.0.push(4);
                self.text(value);
            }
            TreeKind::List(items) => {
                self.0.push(5);
                self.number(items.len());
                items.iter().for_each(|item| self.tree(item));
            }
            TreeKind::Map(entries) => {
                self.0.push(6);
                self.number(entries.len());
                for (key, value) in entries {
                    self.text(&key.value);
                    self.tree(value);
                }
            }
        }
    }
}

struct Reader<'b>(&'b [u8]);

impl<'b> Reader<'b> {
    fn take(&mut self, len: usize) -> Option<&'b [u8]> {
        let (taken, rest) = self.0.split_at_checked(len)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    fn number(&mut self) -> Option<usize> {
        let mut number = 0usize;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= usize::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(number);
            }
        }
        None
    }

    /// A number of things that take at least a byte each: what is made room for cannot be more than what is there.
    fn count(&mut self) -> Option<usize> {
        self.number().filter(|count| *count <= self.0.len())
    }

    fn list<T>(&mut self, read: impl Fn(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        (0..self.count()?).map(|_| read(self)).collect()
    }

    fn distance(&mut self, from: u32) -> Option<u32> {
        let (number, from) = (self.number()?, from as usize);
        let to = match number % 2 {
            0 => from.checked_sub(number / 2)?,
            _ => from + number / 2,
        };
        u32::try_from(to).ok()
    }

    fn text(&mut self) -> Option<&'b str> {
        let len = self.number()?;
        std::str::from_utf8(self.take(len)?).ok()
    }

    fn maybe_tree(&mut self, depth: usize) -> Option<Option<Tree>> {
        match self.byte()? {
            0 => Some(None),
            1 => self.tree(depth).map(Some),
            _ => None,
        }
    }

    fn tree(&mut self, depth: usize) -> Option<Tree> {
        if depth > DEEPEST {
            return None;
        }
        let kind = match self.byte()? {
            0 => TreeKind::Null,
            1 => TreeKind::Bool(self.byte()? == 1),
            2 => TreeKind::Integer(i64::from_le_bytes(*self.take(8)?.first_chunk()?)),
            3 => TreeKind::Float(f64::from_bits(u64::from_le_bytes(*self.take(8)?.first_chunk()?))),
            4 => TreeKind::Text(self.text()?.to_string()),
            5 => TreeKind::List(self.list(|r| r.tree(depth + 1))?),
            6 => TreeKind::Map(self.list(|r| {
                let key = Spanned {
                    value: r.text()?.to_string(),
                    span: Span::default(),
                };
                Some((key, r.tree(depth + 1)?))
            })?),
            _ => return None,
        };
        Some(Tree {
            span: Span::default(),
            kind,
        })
    }
}
