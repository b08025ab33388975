//! Values: wanted, read from the store, computed again, dropped.

use std::sync::Arc;

use super::{Machine, Phase};
use crate::AnyValue;
use crate::run::jobs::Job;

/// A value larger than this is given back to the system by another thread: that takes longer than all that the
/// coordinator has to do for a node, a tenth of a microsecond for every page of 4 KiB.
const FREED_ELSEWHERE: u64 = 1 << 18;

impl Machine<'_> {
    /// Waits for the values at all demanded ports.
    pub(super) fn want_values(&mut self, slot: u32, then: Phase) {
        let demanded = self.slots[slot as usize].demanded;
        for wire in self.wires(slot, demanded) {
            self.take_small(wire.from);
        }
        let state = self.slot(slot);
        state.phase = then;
        state.waiting = 0;
        for wire in self.wires(slot, demanded) {
            if self.slots[wire.from as usize].phase == Phase::Failed {
                self.skip(slot, wire.from);
                return;
            }
            if self.slots[wire.from as usize].value.is_none() {
                self.slot(slot).waiting += 1;
                self.request_value(wire.from);
            }
        }
        if self.slots[slot as usize].waiting == 0 {
            self.values_there(slot);
        }
    }

    pub(super) fn values_there(&mut self, slot: u32) {
        match self.slots[slot as usize].phase {
            Phase::ValuesToDecide => {
                let Some(node) = self.graph.node_at(self.site_of(slot)) else {
                    return;
                };
                let mut values = vec![None; self.ports(slot).len()];
                for wire in self.wires(slot, self.slots[slot as usize].demanded) {
                    values[usize::from(wire.port)] = self.slots[wire.from as usize].value.clone();
                }
                self.slot(slot).phase = Phase::Deciding;
                self.urgent.push(Job::Decide {
                    slot,
                    node: Arc::clone(&node.node),
                    output: node.spec.outputs[self.graph.port_of(slot)].name,
                    ports: self.known_ports(slot, self.slots[slot as usize].demanded),
                    values,
                });
            }
            Phase::ValuesToRun => self.queue(slot),
            _ => {}
        }
    }

    pub(super) fn queue(&mut self, slot: u32) {
        self.slot(slot).phase = Phase::Queued;
        let height = self.height[self.site_of(slot) as usize];
        self.ready.push((height, std::cmp::Reverse(slot)));
    }

    /// Somebody needs the value of a slot whose digest is known.
    pub fn request_value(&mut self, slot: u32) {
        let state = &self.slots[slot as usize];
        if state.value.is_some() || state.loading || state.phase != Phase::Done {
            return; // there, or on its way
        }
        let (digest, bytes) = (state.digest, state.bytes);
        if self.store.is_some() && self.cacheable(slot) {
            self.slot(slot).loading = true;
            self.urgent.push(Job::Load {
                slot,
                digest,
                value_type: self.graph.slot_type(slot),
                bytes,
            });
        } else {
            self.run_again(slot);
        }
    }

    /// Takes a value that stands in a record of the store at once: a job would cost more than it.
    fn take_small(&mut self, slot: u32) {
        let state = &self.slots[slot as usize];
        if state.value.is_some() || state.loading || state.phase != Phase::Done || !self.cacheable(slot) {
            return;
        }
        let value_type = self.graph.slot_type(slot);
        let small = self
            .store
            .as_ref()
            .and_then(|store| store.load_small(&state.digest, &value_type));
        if let Some(value) = small {
            self.set_value(slot, value);
        }
    }

    /// The store has answered.
    pub fn loaded(&mut self, slot: u32, value: Option<AnyValue>) {
        self.slot(slot).loading = false;
        match value {
            Some(value) => self.set_value(slot, value),
            None => self.run_again(slot),
        }
    }

    /// The value is needed and gone: computes it again, from what was demanded before.
    pub(super) fn run_again(&mut self, slot: u32) {
        let state = self.slot(slot);
        state.again = true;
        state.phase = Phase::Again;
        self.begun.push(slot);
        for wire in self.graph.wires_of(self.site_of(slot)) {
            self.slots[wire.from as usize].readers += 1;
        }
        self.agenda.push(slot);
    }

    pub(super) fn begin_again(&mut self, slot: u32) {
        if (slot as usize) < self.graph.inputs().len() {
            self.queue(slot);
        } else {
            self.want_values(slot, Phase::ValuesToRun);
        }
    }

    pub(super) fn set_value(&mut self, slot: u32, value: AnyValue) {
        self.hold(slot, value);
        for reading in self.graph.readers_of(slot) {
            for reader in self.graph.slots_of(reading.site) {
                let state = self.slot(reader);
                let waits = matches!(state.phase, Phase::ValuesToDecide | Phase::ValuesToRun);
                if waits && state.demanded & (1 << reading.port) != 0 {
                    state.waiting -= 1;
                    if state.waiting == 0 {
                        self.values_there(reader);
                    }
                }
            }
        }
        self.drop_if_unread(slot);
    }

    pub(super) fn drop_if_unread(&mut self, slot: u32) {
        let cacheable = self.cacheable(slot);
        let state = self.slot(slot);
        // What is not cached cannot be had again with the same bits: it stays until the end.
        if state.readers == 0
            && !state.pinned
            && cacheable
            && let Some(value) = state.value.take()
        {
            let bytes = state.bytes;
            self.held_bytes -= bytes;
            if bytes > FREED_ELSEWHERE {
                self.dropped.push(value);
            }
        }
    }

    /// Keeps a value as long as somebody may read it.
    pub(super) fn hold(&mut self, slot: u32, value: AnyValue) {
        let state = self.slot(slot);
        let before = state.value.as_ref().map_or(0, |_| state.bytes);
        state.bytes = value.size_bytes() as u64;
        state.value = Some(value);
        self.held_bytes = self.held_bytes - before + self.slots[slot as usize].bytes;
    }
}
