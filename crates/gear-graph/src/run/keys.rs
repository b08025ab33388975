//! Keys of actions.
//!
//! An action is one output port of one node, and its key says everything that its value depends on:
//!
//! ```text
//! site    = H(format, node type, version, numerics of its crates, parameters, realm, elision mode)
//! k_0     = H(site, output, digests at the ports that are always needed)
//! k_{i+1} = H(k_i, digests at the ports that were asked for at k_i)
//! ```
//!
//! Ports go in sorted by name, so that a definition may be reordered. Keys hold digests of values, never keys of
//! parents, no path, no time and no machine. A graph input is an action too: its `site` holds the loader's version and
//! parameters and the digest of the file.

use crate::graph::GraphInput;
use crate::{Digest, GraphNode, Hasher, Numerics, ParamValues, PortSpec};

/// Raised when keys are made differently; what is stored is then a clean miss.
const FORMAT: u64 = 1;

/// What all outputs of a node have in common.
pub(super) fn of_node(node: &GraphNode, realm: &str, elision: bool) -> Digest {
    let spec = &node.spec;
    let mut hasher = Hasher::new("node");
    hasher.u64(FORMAT).bytes(spec.name.as_bytes()).u64(spec.version.into());
    numerics(&mut hasher, &spec.numerics);
    params(&mut hasher, node.params());
    hasher.bytes(realm.as_bytes());
    // Only nodes with lazy ports can leave something out.
    if !elision && spec.inputs.iter().any(|port| port.lazy) {
        hasher.bytes(b"no elision");
    }
    hasher.finish()
}

/// A seed for the node's random numbers: its type and parameters, nothing else.
pub(super) fn seed(node: &GraphNode) -> u64 {
    let mut hasher = Hasher::new("seed");
    hasher.bytes(node.spec.name.as_bytes());
    params(&mut hasher, node.params());
    let digest = hasher.finish();
    digest.0.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes))
}

/// The key of loading an input from a source with this digest.
pub(super) fn of_input(input: &GraphInput, source: &Digest) -> Digest {
    let mut hasher = Hasher::new("load");
    hasher.u64(FORMAT).bytes(input.value_type.name.as_bytes());
    if let Some(loader) = &input.loader {
        hasher.u64(loader.version.into());
        numerics(&mut hasher, &loader.numerics);
    }
    params(&mut hasher, input.params());
    hasher.digest(source).finish()
}

/// `k_0`.
pub(super) fn first(site: &Digest, output: &str, ports: &[(&PortSpec, Vec<Digest>)]) -> Digest {
    let mut hasher = Hasher::new("action");
    hasher.digest(site).bytes(output.as_bytes());
    add_ports(&mut hasher, ports);
    hasher.finish()
}

/// `k_{i+1}`.
pub(super) fn next(key: &Digest, ports: &[(&PortSpec, Vec<Digest>)]) -> Digest {
    let mut hasher = Hasher::new("demanded");
    hasher.digest(key);
    add_ports(&mut hasher, ports);
    hasher.finish()
}

fn add_ports(hasher: &mut Hasher, ports: &[(&PortSpec, Vec<Digest>)]) {
    let mut sorted: Vec<_> = ports.iter().collect();
    sorted.sort_by_key(|(port, _)| port.name);
    for (port, digests) in sorted {
        hasher.bytes(port.name.as_bytes()).u64(digests.len() as u64);
        for digest in digests {
            hasher.digest(digest);
        }
    }
}

fn numerics(hasher: &mut Hasher, numerics: &[Numerics]) {
    hasher.u64(numerics.len() as u64);
    for numerics in numerics {
        hasher.bytes(numerics.name.as_bytes()).u64(numerics.version.into());
    }
}

fn params(hasher: &mut Hasher, params: ParamValues) {
    if params.is_empty() {
        hasher.u64(0);
        return;
    }
    let mut value = serde_json::Value::Object(params);
    value.sort_all_objects();
    hasher.bytes(value.to_string().as_bytes());
}
