//! Jobs that run nodes and load inputs, and what comes back from them.

use std::sync::Arc;

use super::{Machine, Phase};
use crate::run::inputs::{Given, Source};
use crate::run::jobs::{Computed, Job, Trouble};
use crate::store::{Done, Record};
use crate::{AnyValue, Digest, NodeError, Slot, Want};

/// How many times larger than its file a value may be: a photograph of 8 bits as floats, compressed tenfold.
const DECODED: u64 = 40;

impl Machine<'_> {
    /// The next job that computes something, most urgent first.
    pub fn next_run(&mut self) -> Option<Job> {
        while let Some((_, std::cmp::Reverse(slot))) = self.ready.pop() {
            if self.slots[slot as usize].phase != Phase::Queued {
                continue; // ran together with another output
            }
            let site = self.site_of(slot);
            let Some(node) = self.graph.node_at(site) else {
                self.slot(slot).phase = Phase::Running;
                let input = &self.graph.inputs()[slot as usize];
                if let (Given::Source { source, .. }, Some(loader)) = (&self.given[slot as usize], &input.load) {
                    let bytes = source.bytes() * DECODED;
                    return Some(Job::LoadInput {
                        slot,
                        loader: Arc::clone(loader),
                        source: Source::clone(source),
                        value_type: input.value_type,
                        bytes,
                    });
                }
                continue;
            };
            let demanded = self.slots[slot as usize].demanded;
            let together: Vec<u32> = self
                .graph
                .slots_of(site)
                .filter(|other| {
                    let other = &self.slots[*other as usize];
                    other.phase == Phase::Queued && other.demanded == demanded
                })
                .collect();
            let mut inputs: Vec<Slot> = vec![Vec::new(); node.spec.inputs.len()];
            for wire in self.wires(slot, demanded) {
                // All values were there when the slot was queued, and its own wires hold them.
                let value = self.slots[wire.from as usize].value.clone();
                inputs[usize::from(wire.port)].push(value.expect("held by the reader that is about to run"));
            }
            let ports: Vec<usize> = together.iter().map(|slot| self.graph.port_of(*slot)).collect();
            let names = node.spec.outputs.iter().enumerate();
            let want = Want::from_ports(names.map(|(i, port)| (port.name, ports.contains(&i))).collect());
            for slot in &together {
                self.slot(*slot).phase = Phase::Running;
            }
            return Some(Job::Run {
                slots: together,
                node: Arc::clone(&node.node),
                inputs,
                want,
                ports,
            });
        }
        None
    }

    /// The key under which the unfinished state of a node that is about to run may be kept; `None` if what it gives is not
    /// to be stored, or not to be taken from the store.
    pub fn unfinished_key(&self, slot: u32) -> Option<Digest> {
        let site = self.site_of(slot);
        self.graph.node_at(site)?;
        let wanted = self.cacheable(slot) && !self.run.fresh.contains(self.graph.site_name(site));
        wanted.then_some(self.slots[slot as usize].key)?
    }

    /// A node (or a loader) has run.
    pub fn ran(
        &mut self,
        slots: &[u32],
        result: Result<Vec<Computed>, Trouble>,
        seconds: f64,
        peak: u64,
        notes: Vec<String>,
    ) {
        let Some(first) = slots.first() else { return };
        let site = self.site_of(*first);
        let state = &mut self.sites[site as usize];
        state.seconds += seconds;
        state.peak = state.peak.max(peak);
        match result {
            Err(trouble) => self.fail_all(slots, trouble),
            Ok(values) => {
                state.ran = true;
                self.note(site, &notes);
                for (slot, computed) in slots.iter().zip(values) {
                    self.computed(*slot, computed, seconds, peak, &notes);
                }
            }
        }
    }

    pub(super) fn computed(&mut self, slot: u32, computed: Computed, seconds: f64, peak: u64, notes: &[String]) {
        let Computed { value, digest, content } = computed;
        let again = std::mem::take(&mut self.slot(slot).again);
        if again && self.slots[slot as usize].digest != digest {
            // Keys downstream hold the digest that was promised: going on would store results under wrong keys.
            let was = self.slots[slot as usize].digest;
            let name = self.graph.site_name(self.site_of(slot)).to_string();
            self.fail(
                slot,
                Trouble::Error(NodeError::new(format!(
                    "computing `{}` again gave other bits ({digest:?} instead of {was:?}): the node is not deterministic, \
                     or its version was not raised; run with --fresh {name}",
                    self.graph.slot_name(slot)
                ))),
            );
            return;
        }
        if self.store.is_some() && self.cacheable(slot) {
            let done = self.record(slot, &value, digest, seconds, peak, notes);
            self.publish_origin(slot, &done);
            match content {
                Some(content) => self.publish(Record::Done(Done {
                    content: Some(content),
                    ..done
                })),
                None => {
                    self.keep_bytes += value.size_bytes();
                    self.keep.push_back(Job::Keep {
                        value: value.clone(),
                        done: Box::new(done),
                    });
                }
            }
        }
        if again {
            self.slot(slot).phase = Phase::Done;
            self.set_value(slot, value);
            self.release(slot);
        } else {
            // The value first: who is waiting for the digest may want it at once.
            self.hold(slot, value);
            self.done(slot, digest);
            self.drop_if_unread(slot);
        }
    }

    pub(super) fn record(
        &self,
        slot: u32,
        value: &AnyValue,
        digest: Digest,
        seconds: f64,
        peak: u64,
        notes: &[String],
    ) -> Done {
        let site = self.site_of(slot);
        let made = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .map_or(0, |since| since.as_secs());
        Done {
            key: self.slots[slot as usize].key.unwrap_or_default(),
            value: digest,
            content: None,
            label: match self.graph.node_at(site) {
                Some(node) => format!("{}: {}.{}", node.id, node.spec.name, self.graph.port_name(slot)),
                None => format!("{}: input", self.graph.site_name(site)),
            },
            type_name: value.value_type().name.to_string(),
            size: value.size_bytes() as u64,
            seconds,
            peak,
            made,
            reason: self.slots[slot as usize].reason.to_string(),
            notes: notes.to_vec(),
        }
    }

    /// A value was written to the store (or could not be).
    pub fn kept(&mut self, done: Done) {
        self.publish(Record::Done(done));
    }

    pub(super) fn publish(&self, record: Record) {
        if let Some(store) = &self.store {
            store.publish(record);
        }
    }
}
