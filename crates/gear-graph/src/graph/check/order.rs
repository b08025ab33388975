//! The order of work, and the loops that prevent one.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use petgraph::algo::kosaraju_scc;
use petgraph::graph::{DiGraph, NodeIndex};

use crate::graph::file::{File, FileNode};
use crate::graph::{Reading, Wire};
use crate::{Problem, Severity, Span, Spanned};

/// How many wires of a loop are shown in the file; the message names them all, as far as it can be read.
const SHOWN: usize = 20;
/// How many loops are told: each costs a walk through the graph.
const LOOPS: usize = 100;

/// All sites in an order of work that keeps to the order of the file where it can, or the loops that prevent one.
pub(super) fn order(
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
    // A loop is told, its last wire is taken out, and what still goes round is looked for again: who removes a wire of
    // every loop that is told has an order of work, unless loops overlap so that he removed another one.
    let mut told = 0;
    loop {
        // `kosaraju_scc` does not recurse; `tarjan_scc` does, and overflows at 100,000 nodes.
        let knots: Vec<_> = kosaraju_scc(&dag)
            .into_iter()
            .filter(|component| component.len() > 1 || dag.contains_edge(component[0], component[0]))
            .collect();
        for knot in &knots {
            if told < LOOPS {
                let path = shortest_loop(&dag, knot);
                problems.push(cycle(file, &path));
                cut(&mut dag, &path);
            }
            told += 1;
        }
        if knots.is_empty() || told >= LOOPS {
            return None;
        }
    }
}

/// Takes out every wire from the last node of a loop to its first.
fn cut(dag: &mut DiGraph<(), ()>, path: &[NodeIndex]) {
    let (Some(first), Some(last)) = (path.first(), path.last()) else {
        return;
    };
    while let Some(edge) = dag.find_edge(*last, *first) {
        dag.remove_edge(edge);
    }
}

/// The shortest loop through the first node (by place in the file) of a strongly connected component.
fn shortest_loop(dag: &DiGraph<(), ()>, component: &[NodeIndex]) -> Vec<NodeIndex> {
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
    path
}

/// The nodes of this loop wait for each other.
fn cycle(file: &File<'_>, path: &[NodeIndex]) -> Problem {
    // Only nodes can be in a loop: inputs have no wires into them.
    let node = |site: &NodeIndex| &file.nodes[site.index() - file.inputs.len()];
    let mut names: Vec<_> = path.iter().map(|site| node(site).id.value.as_str()).collect();
    let wires = path.iter().enumerate().map(|(i, site)| {
        let from = names[(i + path.len() - 1) % path.len()];
        let reader = &node(site).id;
        let span = wire(node(site), from).unwrap_or(reader.span);
        let remark = if reader.value == from {
            format!("`{from}` reads itself")
        } else {
            format!("`{}` reads `{from}`", reader.value)
        };
        (span, remark)
    });
    let labels = wires.take(SHOWN).collect();
    names.push(names[0]);
    let problem = Problem {
        code: "cycle",
        severity: Severity::Error,
        message: format!("these nodes wait for each other: {}", names.join(" → ")),
        labels,
        help: None,
    };
    problem.help("a node cannot depend on its own result; remove one of these wires")
}

/// Where a node reads another one.
fn wire(node: &FileNode<'_>, from: &str) -> Option<Span> {
    let mut refs = node.inputs.iter().flat_map(|(_, wiring)| &wiring.refs);
    let reads = |source: &&Spanned<&str>| source.value.split_once('.').is_some_and(|(id, _)| id == from);
    refs.find(reads).map(|source| source.span)
}

/// The wires out of every slot, in the order of the sites that read it.
pub fn readers(slots: usize, wires: &[Wire], first_wire: &[u32]) -> (Vec<Reading>, Vec<u32>) {
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
