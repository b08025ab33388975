//! What keys are made of, kept beside results so that they can be explained.

use super::Machine;
use crate::run::inputs::Given;
use crate::store::{Done, Origin, Parts, PortPart};
use crate::{Digest, Numerics, ParamValues};

impl Machine<'_> {
    /// What the key of a slot is made of when it demands some ports, and the wires to them whose digests are not known
    /// yet.
    pub fn parts(&self, slot: u32, demanded: u64) -> (Parts, Vec<crate::graph::Wire>) {
        let site = self.site_of(slot);
        let Some(node) = self.graph.node_at(site) else {
            return (self.parts_of_input(slot), Vec::new());
        };
        let specs = self.ports(slot);
        let mut ports: Vec<(u16, Vec<Digest>, u32)> = Vec::new();
        let mut open = Vec::new();
        for wire in self.wires(slot, demanded) {
            if !self.known(wire.from) {
                open.push(wire);
                continue;
            }
            let digest = self.slots[wire.from as usize].digest;
            match ports.last_mut() {
                Some((port, digests, _)) if *port == wire.port => digests.push(digest),
                _ => ports.push((wire.port, vec![digest], wire.from)),
            }
        }
        // A port of which one value is not known yet cannot be compared.
        ports.retain(|(port, ..)| open.iter().all(|wire| wire.port != *port));
        let parts = Parts {
            input: false,
            type_name: node.spec.name.to_string(),
            version: node.spec.version,
            numerics: numerics(&node.spec.numerics),
            realm: node.node.realm(&self.run.resources),
            no_elision: !self.run.elision && specs.iter().any(|port| port.lazy),
            params: params(node.params()),
            ports: ports
                .into_iter()
                .map(|(port, digests, from)| {
                    PortPart::new(specs[usize::from(port)].name, self.graph.slot_name(from), digests)
                })
                .collect(),
        };
        (parts, open)
    }

    fn parts_of_input(&self, slot: u32) -> Parts {
        let input = &self.graph.inputs()[slot as usize];
        let loader = input.loader.as_deref();
        Parts {
            input: true,
            type_name: input.value_type.name.to_string(),
            version: loader.map_or(0, |loader| loader.version),
            numerics: loader.map(|loader| numerics(&loader.numerics)).unwrap_or_default(),
            realm: "cpu".to_string(),
            no_elision: false,
            params: params(input.params()),
            ports: match &self.given[slot as usize] {
                Given::Source { source, digest } => vec![PortPart::new("file", source.name(), vec![*digest])],
                _ => Vec::new(),
            },
        }
    }

    /// Keeps where a value came from that was just computed.
    pub(super) fn publish_origin(&self, slot: u32, done: &Done) {
        let Some(store) = &self.store else { return };
        store.publish_origin(&Origin {
            key: done.key,
            run: self.id,
            made: done.made,
            seconds: done.seconds,
            graph: self.graph.name().to_string(),
            site: self.graph.site_name(self.site_of(slot)).to_string(),
            output: self.graph.port_name(slot).to_string(),
            parts: self.parts(slot, self.slots[slot as usize].demanded).0,
        });
    }
}

/// A number that no other run has: of the time, the process, and how many runs it began.
pub(super) fn new_id() -> u64 {
    use std::sync::atomic::{AtomicU64, Ordering};
    static RUNS: AtomicU64 = AtomicU64::new(0);
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let mut hasher = crate::Hasher::new("run");
    hasher
        .u64(since.map_or(0, |since| since.as_nanos() as u64))
        .u64(std::process::id().into())
        .u64(RUNS.fetch_add(1, Ordering::Relaxed));
    hasher
        .finish()
        .0
        .first_chunk()
        .map_or(0, |bytes| u64::from_le_bytes(*bytes))
}

fn numerics(numerics: &[Numerics]) -> Vec<(String, u32)> {
    numerics.iter().map(|n| (n.name.to_string(), n.version)).collect()
}

fn params(params: ParamValues) -> String {
    if params.is_empty() {
        return String::new();
    }
    serde_json::Value::Object(params).to_string()
}
