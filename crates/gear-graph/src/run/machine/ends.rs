//! How slots end: known, failed, skipped, dead; and what they let go of.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::{Happened, Machine, Phase};
use crate::run::Values;
use crate::run::inputs::Given;
use crate::run::jobs::Trouble;
use crate::run::report::{Failure, FailureKind, InputSummary};
use crate::store::Done;
use crate::{Digest, NodeError};

impl Machine<'_> {
    pub(super) fn hit(&mut self, slot: u32, done: Done) {
        let site = self.site_of(slot) as usize;
        self.sites[site].saved = self.sites[site].saved.max(done.seconds);
        self.sites[site].peak = self.sites[site].peak.max(done.peak);
        self.note(site as u32, &done.notes);
        let state = self.slot(slot);
        state.hit = true;
        state.bytes = done.size;
        state.reason = done.reason.into();
        self.happened.push(Happened::Hit(slot));
        self.done(slot, done.value);
    }

    pub fn note(&mut self, site: u32, notes: &[String]) {
        for note in notes {
            if !self.sites[site as usize].notes.contains(note) {
                self.sites[site as usize].notes.push(note.clone());
                self.happened.push(Happened::Note {
                    site,
                    note: note.clone(),
                });
            }
        }
    }

    /// The digest of a slot is known.
    pub(super) fn done(&mut self, slot: u32, digest: Digest) {
        let state = self.slot(slot);
        state.phase = Phase::Done;
        state.digest = digest;
        for reading in self.graph.readers_of(slot) {
            for reader in self.graph.slots_of(reading.site) {
                let state = self.slot(reader);
                if state.phase == Phase::Digests && state.asked & (1 << reading.port) != 0 {
                    state.waiting -= 1;
                    if state.waiting == 0 {
                        self.agenda.push(reader);
                    }
                }
            }
        }
        self.release(slot);
        if self.slots[slot as usize].pinned && self.output_wants_value(slot) {
            self.request_value(slot);
        }
    }

    /// Whether the run must be able to give the value of a slot that is an output, not only its digest.
    fn output_wants_value(&self, slot: u32) -> bool {
        match &self.run.values {
            Values::Digests => false,
            Values::All => true,
            Values::Where(wants) => {
                let mut outputs = self.graph.outputs().iter().filter(|output| output.slot == slot);
                let digest = &self.slots[slot as usize].digest;
                outputs.any(|output| self.run.asks_for(&output.name) && wants(&output.name, digest))
            }
        }
    }

    /// A slot is settled: it reads its inputs no more. Those that nobody else reads are dropped or dead.
    pub(super) fn release(&mut self, slot: u32) {
        let mut stack = vec![slot];
        while let Some(slot) = stack.pop() {
            for wire in self.graph.wires_of(self.graph.site_of[slot as usize]) {
                let from = &mut self.slots[wire.from as usize];
                debug_assert!(from.readers > 0, "a wire was released twice");
                from.readers = from.readers.saturating_sub(1);
                if from.readers > 0 {
                    continue;
                }
                if from.phase == Phase::Idle {
                    from.phase = Phase::Dead;
                    stack.push(wire.from);
                } else {
                    self.drop_if_unread(wire.from);
                }
            }
        }
    }

    pub(super) fn fail_all(&mut self, slots: &[u32], trouble: Trouble) {
        if let Some(first) = slots.first() {
            self.fail(*first, trouble);
        }
        for slot in slots.iter().skip(1) {
            let site = self.site_of(*slot);
            self.failed(*slot, site);
        }
    }

    pub(super) fn fail(&mut self, slot: u32, trouble: Trouble) {
        let site = self.site_of(slot);
        let interrupted = self.run.cancel.is_raised();
        if matches!(trouble, Trouble::Error(NodeError::Cancelled)) && interrupted {
            return; // the slot stays as unfinished as it is
        }
        let (kind, chain) = match (&trouble, self.graph.node_at(site)) {
            (Trouble::Error(error), None) => {
                let source = match &self.given[site as usize] {
                    Given::Source { source, .. } => source.name(),
                    _ => self.graph.site_name(site).to_string(),
                };
                let mut chain = error.chain();
                chain[0] = format!("{source}: {}", chain[0]);
                (FailureKind::Load, chain)
            }
            (Trouble::Error(error), Some(_)) => (FailureKind::Error, error.chain()),
            (Trouble::Panic(message), _) => (FailureKind::Panic, vec![message.clone()]),
        };
        let specs = self.ports(slot);
        let inputs = self
            .wires(slot, self.slots[slot as usize].demanded)
            .filter_map(|wire| {
                let from = &self.slots[wire.from as usize];
                let value = from.value.as_ref()?;
                Some(InputSummary {
                    port: specs[usize::from(wire.port)].name.to_string(),
                    source: self.graph.slot_name(wire.from),
                    type_name: value.value_type().name,
                    digest: from.digest.hex(),
                    // A summary that panics must not cost the message that it is for.
                    summary: catch_unwind(AssertUnwindSafe(|| value.summary())).unwrap_or_default(),
                })
            })
            .collect();
        let type_name = match self.graph.node_at(site) {
            Some(node) => node.spec.name,
            None => self.graph.slot_type(slot).name,
        };
        self.sites[site as usize].failed = true;
        self.failures.push(Failure {
            node: self.graph.site_name(site).to_string(),
            type_name: type_name.to_string(),
            kind,
            chain,
            inputs,
        });
        self.happened.push(Happened::Failed(self.failures.len() - 1));
        self.failed(slot, site);
    }

    pub(super) fn skip(&mut self, slot: u32, because_of: u32) {
        let by_site = self.site_of(because_of);
        let root = self.sites[by_site as usize].skipped_by.unwrap_or(by_site);
        self.failed(slot, root);
    }

    /// A slot will never be known; nor will those that wait for it, and so on. `root` is the site that failed first.
    pub(super) fn failed(&mut self, slot: u32, root: u32) {
        let mut stack = vec![slot];
        while let Some(slot) = stack.pop() {
            let site = self.site_of(slot);
            if self.slots[slot as usize].phase == Phase::Failed {
                continue;
            }
            self.slot(slot).phase = Phase::Failed;
            if site != root && !self.sites[site as usize].failed && self.sites[site as usize].skipped_by.is_none() {
                self.sites[site as usize].skipped_by = Some(root);
                self.happened.push(Happened::Skipped { site, by: root });
            }
            for reading in self.graph.readers_of(slot) {
                for reader in self.graph.slots_of(reading.site) {
                    let state = &self.slots[reader as usize];
                    let waits = match state.phase {
                        Phase::Digests => state.asked,
                        Phase::ValuesToDecide | Phase::ValuesToRun => state.demanded,
                        _ => 0,
                    };
                    if waits & (1 << reading.port) != 0 {
                        stack.push(reader);
                    }
                }
            }
            self.release(slot);
        }
    }
}
