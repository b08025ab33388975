//! Which nodes of which variants are one and the same.
//!
//! A node is known by what it computes: its type and version, its parameters, and what is wired to its ports, down to
//! the inputs. Two nodes of one identity give equal results on one case, and the store has the second one's before it
//! is asked for. (The store knows more: it also sees that different parameters gave equal values.)

use std::collections::HashMap;

use gear_graph::{Digest, Graph, Hasher};

/// The identity of every node of a graph, by its id.
pub fn identities(graph: &Graph) -> HashMap<&str, Digest> {
    let mut known: HashMap<&str, Digest> = HashMap::new();
    let mut inputs: HashMap<&str, Digest> = HashMap::new();
    for input in graph.inputs() {
        let mut hasher = Hasher::new("study input");
        hasher
            .bytes(input.name.as_bytes())
            .bytes(text(&input.params()).as_bytes());
        inputs.insert(&input.name, hasher.finish());
    }
    let wiring: Vec<_> = (0..graph.nodes().len()).map(|node| graph.wiring(node)).collect();
    // A pass knows every node whose sources are known; graphs have no cycle, so each pass knows one more at least.
    loop {
        let before = known.len();
        for (node, wires) in graph.nodes().iter().zip(&wiring) {
            if known.contains_key(node.id.as_str()) {
                continue;
            }
            let mut hasher = Hasher::new("study node");
            hasher
                .bytes(node.spec.name.as_bytes())
                .u64(u64::from(node.spec.version))
                .bytes(text(&node.params()).as_bytes());
            let mut complete = true;
            for (port, source) in wires {
                let (owner, output) = source.split_once('.').unwrap_or((source, ""));
                let of = if output.is_empty() {
                    inputs.get(owner)
                } else {
                    known.get(owner)
                };
                match of {
                    Some(digest) => {
                        hasher.bytes(port.as_bytes()).bytes(output.as_bytes()).digest(digest);
                    }
                    None => complete = false,
                }
            }
            if complete {
                known.insert(&node.id, hasher.finish());
            }
        }
        if known.len() == before {
            return known;
        }
    }
}

fn text(params: &gear_graph::ParamValues) -> String {
    serde_json::to_string(params).unwrap_or_default()
}
