//! Digests of inputs, keys made of them, and what the store knows at a key.

use super::{Machine, Phase};
use crate::run::inputs::Given;
use crate::run::jobs::Trouble;
use crate::run::keys;
use crate::store::Record;
use crate::{Digest, NodeError, PortSpec};

impl Machine<'_> {
    /// Somebody needs the digest of a slot.
    pub fn request(&mut self, slot: u32) {
        let state = self.slot(slot);
        if state.phase == Phase::Idle {
            state.phase = Phase::Requested;
            self.agenda.push(slot);
            self.begun.push(slot);
        }
    }

    /// The key of a slot, and the one that it has on the cpu if its realm is another.
    pub fn keys(&self, slot: u32) -> [Option<Digest>; 2] {
        let state = &self.slots[slot as usize];
        [state.key, state.cpu_key]
    }

    /// Whether the digest of a slot is known.
    pub fn known(&self, slot: u32) -> bool {
        let state = &self.slots[slot as usize];
        state.phase == Phase::Done || state.again
    }

    pub(super) fn begin_input(&mut self, slot: u32) {
        let input = &self.graph.inputs()[slot as usize];
        match &self.given[slot as usize] {
            // Nobody asks for what is absent, except an output that is an optional input.
            Given::Absent => {
                self.fail(slot, Trouble::Error(NodeError::new("the optional input was not given")));
            }
            Given::Value(value) => {
                let value = value.clone();
                let digest = value.digest();
                // The value first: `done` may ask for it.
                self.slot(slot).pinned = true;
                self.hold(slot, value);
                self.done(slot, digest);
            }
            Given::Source { digest, .. } => {
                let key = keys::of_input(input, digest);
                self.slot(slot).key = Some(key);
                match self.find(slot, &key) {
                    Some(Record::Done(done)) => self.hit(slot, done),
                    _ => self.queue(slot),
                }
            }
        }
    }

    /// Adds ports to what a slot demands, and waits for their digests.
    pub(super) fn ask(&mut self, slot: u32, ports: u64) {
        let state = self.slot(slot);
        state.phase = Phase::Digests;
        state.demanded |= ports;
        state.asked = ports;
        state.waiting = 0;
        for wire in self.wires(slot, ports) {
            if self.slots[wire.from as usize].phase == Phase::Failed {
                self.skip(slot, wire.from);
                return;
            }
            if !self.known(wire.from) {
                self.slot(slot).waiting += 1;
                self.request(wire.from);
            }
        }
        if self.slots[slot as usize].waiting == 0 {
            self.agenda.push(slot);
        }
    }

    /// All digests that were asked for are there: make the next key and see what is known at it.
    pub(super) fn look_up(&mut self, slot: u32) {
        let state = &self.slots[slot as usize];
        let (asked, before) = (state.asked, state.key);
        let mut ports: Vec<(&PortSpec, Vec<Digest>)> = Vec::new();
        let specs = self.ports(slot);
        for wire in self.wires(slot, asked) {
            let port = &specs[usize::from(wire.port)];
            let digest = self.slots[wire.from as usize].digest;
            match ports.last_mut() {
                Some((last, digests)) if last.name == port.name => digests.push(digest),
                _ => ports.push((port, vec![digest])),
            }
        }
        let (base, cpu_base) = self.base(slot);
        let output = self.graph.port_name(slot);
        let key = match before {
            None => keys::first(&base, output, &ports),
            Some(before) => keys::next(&before, &ports),
        };
        let cpu_key = match (before, cpu_base, self.slots[slot as usize].cpu_key) {
            (None, Some(base), _) => Some(keys::first(&base, output, &ports)),
            (Some(_), _, Some(before)) => Some(keys::next(&before, &ports)),
            _ => None,
        };
        let state = self.slot(slot);
        (state.key, state.cpu_key) = (Some(key), cpu_key);
        let found = self.find(slot, &key).or_else(|| self.find(slot, &cpu_key?));
        match found {
            Some(Record::Done(done)) => self.hit(slot, done),
            Some(Record::Need(need)) if self.run.elision => match self.needed(slot, &need.ports) {
                Some(ports) => self.ask(slot, ports),
                // A record that asks for what cannot be asked for is not believed.
                None => self.decide(slot),
            },
            _ => self.decide(slot),
        }
    }

    /// What all outputs of a slot's site have in common, in its realm and, if that is another, on the cpu.
    pub(super) fn base(&mut self, slot: u32) -> (Digest, Option<Digest>) {
        let site = self.site_of(slot);
        if let Some(base) = self.sites[site as usize].base {
            return base;
        }
        let Some(node) = self.graph.node_at(site) else {
            return Default::default();
        };
        let of = |realm: &str| keys::of_node(node, realm, self.run.elision);
        let realm = node.node.realm(&self.run.resources);
        let base = (of(&realm), (realm != "cpu").then(|| of("cpu")));
        self.sites[site as usize].base = Some(base);
        base
    }

    /// What the store knows at a key, unless it must not be asked.
    pub(super) fn find(&self, slot: u32, key: &Digest) -> Option<Record> {
        let site = self.site_of(slot);
        if self.run.fresh.contains(self.graph.site_name(site)) {
            return None;
        }
        if !self.cacheable(slot) {
            return None;
        }
        let found = self.store.as_ref()?.lookup(key)?;
        // Computing it again would give something else: an answer that is lost is a question to be asked anew.
        let lost = match (&found, self.graph.node_at(site)) {
            (Record::Done(done), Some(node)) if !node.spec.deterministic => !self.stored(&done.value),
            _ => false,
        };
        (!lost).then_some(found)
    }

    /// Whether the value with this digest can be had from the store.
    pub fn stored(&self, value: &Digest) -> bool {
        self.store.as_ref().is_some_and(|store| store.has_value(value))
    }

    pub fn cacheable(&self, slot: u32) -> bool {
        self.run.cache_nondeterministic || self.graph.node_at(self.site_of(slot)).is_none_or(|node| node.spec.kept)
    }

    /// The bits of ports that may be asked for by these names; `None` if one may not.
    pub(super) fn needed<S: AsRef<str>>(&self, slot: u32, names: &[S]) -> Option<u64> {
        let (_, lazy) = self.wired(slot);
        let new = lazy & !self.slots[slot as usize].demanded;
        let ports = self.ports(slot);
        let mut bits = 0;
        for name in names {
            let port = ports.iter().position(|port| port.name == name.as_ref())?;
            bits |= 1u64 << port;
        }
        (bits != 0 && bits & !new == 0).then_some(bits)
    }
}
