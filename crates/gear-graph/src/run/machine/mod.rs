//! The planner: from the outputs asked for, backwards, to what must run.
//!
//! # How it works
//!
//! Every output port of a node (a *slot*) goes through the same few states, and all of them are kept in one flat
//! array. Nothing here computes a value, waits or recurses: methods change states and put slots on the `agenda` or
//! jobs into the queues, and the scheduler takes them from there.
//!
//! ```text
//!            request                all digests known              Done in the store
//!   Idle ───────────▶ Digests ─────────────────────▶ look up k_i ───────────────────▶ Done
//!    │                   ▲                              │   │ nothing
//!    │ readers settled   │ Need(P): ask P for digests ◀─┘   ▼
//!    ▼                   └───────────────────────────── demand ──(looks at values)──▶ Values ─▶ Deciding ─┐
//!   Dead                                                   │ Ready                                        │
//!                                                          ▼                                  Need, Ready │
//!                                                        Values ─▶ Queued ─▶ Running ─▶ Done   ◀──────────┘
//! ```
//!
//! A slot first wants only *digests* of its inputs. Their *values* are wanted only when the action must run, or when
//! `demand` looks at them. A slot that is `Done` by its digest may later be asked for its value; then it is read from
//! the store, and if it is not there any more, the action runs again (`again`), with the inputs that it had demanded.
//!
//! # What must stay true
//!
//! (a) What is asked at k_i depends only on what k_i hashed: `demand` sees values of ports in `demanded` only, and
//!     those digests are in the key.
//! (b) `Need(P)`: P is not empty, lazy, wired and new. So there are at most as many rounds as ports.
//! (c) A job gets the values of `demanded` ports and no others. Outputs share a run only if their sets are equal.
//! (d) Keys are made of digests ([`super::keys`]).
//! (e) A value is kept before its `Done` is published, and a `Done` whose content is missing is a miss only in
//!     `request_value`.
//! (f) is the node's promise; `testing::assert_pure` checks it.
//! (g) With elision off, the key of every node with lazy ports says so.
//! (h) A graph input is an action whose key holds the digest of its file.
//! (i) `readers[s]` counts the wires from `s` into sites of slots that are alive and unsettled. At zero nobody will
//!     ever want `s` again: its value is dropped, or, if it was never requested, it is `Dead` and settles its own
//!     inputs. A slot that runs again holds its inputs once more until it is done.
//! (j) `waiting` is the number of wires (in `asked` while in `Digests`, in `demanded` while in `Values`) whose digest
//!     or value is missing. A digest becomes known once. A value that somebody waits for is not dropped (i), so it
//!     arrives once for every time it was counted as missing.

mod demand;
mod digests;
mod ends;
mod parts;
mod running;
mod values;

use std::collections::BinaryHeap;
use std::sync::Arc;

use super::Run;
use super::inputs::Given;
use super::jobs::Job;
use super::report::Failure;
use crate::graph::Wire;
use crate::store::Store;
use crate::{AnyValue, Digest, Graph, PortSpec};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Nobody asked.
    Idle,
    /// Somebody asked; not looked at yet.
    Requested,
    /// Waits for digests of the ports in `asked`.
    Digests,
    /// Waits for values of the ports in `demanded`, to decide what else is needed.
    ValuesToDecide,
    /// Waits for values of the ports in `demanded`, to run.
    ValuesToRun,
    /// `demand` is at work.
    Deciding,
    /// May run.
    Queued,
    /// Runs.
    Running,
    /// Its digest is known, its value is needed and gone: about to run again.
    Again,
    /// Its digest is known.
    Done,
    /// It failed, or what it depends on did.
    Failed,
    /// Nobody will ask.
    Dead,
}

pub(super) struct SlotState {
    pub phase: Phase,
    /// Some requested output may need it.
    pub alive: bool,
    /// Its value is an output that is asked for.
    pub pinned: bool,
    pub hit: bool,
    /// It runs although its digest is known, because its value is needed and gone.
    pub again: bool,
    /// Its value is being read from the store.
    loading: bool,
    pub key: Option<Digest>,
    /// The key that the action has on the cpu, if its realm is another: what was computed there may serve here.
    cpu_key: Option<Digest>,
    pub digest: Digest,
    pub value: Option<AnyValue>,
    pub bytes: u64,
    /// Ports whose digests are in `key` or will be next.
    pub demanded: u64,
    asked: u64,
    waiting: u32,
    readers: u32,
    /// Why the ports that are not in `demanded` are not needed.
    pub reason: Box<str>,
}

/// What became of a site, for the report.
#[derive(Clone, Default)]
pub(super) struct SiteState {
    base: Option<(Digest, Option<Digest>)>,
    pub ran: bool,
    pub seconds: f64,
    /// What it took when it was computed, if it was stored.
    pub saved: f64,
    pub peak: u64,
    pub notes: Vec<String>,
    pub failed: bool,
    /// The site whose failure this one suffers from.
    pub skipped_by: Option<u32>,
}

/// Something that the scheduler tells the observer.
pub(super) enum Happened {
    Hit(u32),
    Failed(usize),
    Skipped { site: u32, by: u32 },
    Note { site: u32, note: String },
}

pub(super) struct Machine<'r> {
    pub run: &'r Run<'r>,
    /// Identifies the run in explanations; no part of any key.
    pub id: u64,
    pub graph: &'r Graph,
    pub given: Vec<Given>,
    /// Inputs that were not given.
    absent: Arc<[bool]>,
    store: Option<Arc<Store>>,
    pub slots: Vec<SlotState>,
    pub sites: Vec<SiteState>,
    /// How far each site is from the end: the longest way goes first.
    height: Vec<u32>,
    agenda: Vec<u32>,
    /// Slots that were requested, in order; for the plan.
    pub begun: Vec<u32>,
    /// Slots that may run, by height, then by place in the graph.
    ready: BinaryHeap<(u32, std::cmp::Reverse<u32>)>,
    /// Jobs that others wait for: decisions and values from the store.
    pub urgent: Vec<Job>,
    /// Values to write to the store, oldest first, and their bytes.
    pub keep: std::collections::VecDeque<Job>,
    pub keep_bytes: usize,
    /// Bytes of the values in `slots`.
    pub held_bytes: u64,
    /// Large values that nobody reads any more, for another thread to free.
    pub dropped: Vec<AnyValue>,
    pub failures: Vec<Failure>,
    pub warnings: Vec<String>,
    pub happened: Vec<Happened>,
}

impl<'r> Machine<'r> {
    pub fn new(run: &'r Run<'r>, given: Vec<Given>) -> Self {
        let graph = run.graph;
        let slots = (0..graph.slots())
            .map(|_| SlotState {
                phase: Phase::Idle,
                alive: false,
                pinned: false,
                hit: false,
                again: false,
                loading: false,
                key: None,
                cpu_key: None,
                digest: Digest::default(),
                value: None,
                bytes: 0,
                demanded: 0,
                asked: 0,
                waiting: 0,
                readers: 0,
                reason: Box::default(),
            })
            .collect();
        let mut machine = Self {
            run,
            id: parts::new_id(),
            graph,
            absent: given.iter().map(|given| matches!(given, Given::Absent)).collect(),
            given,
            store: run.store.clone(),
            slots,
            sites: vec![SiteState::default(); graph.sites()],
            height: vec![0; graph.sites()],
            agenda: Vec::new(),
            begun: Vec::new(),
            ready: BinaryHeap::new(),
            urgent: Vec::new(),
            keep: Default::default(),
            keep_bytes: 0,
            held_bytes: 0,
            dropped: Vec::new(),
            failures: Vec::new(),
            warnings: Vec::new(),
            happened: Vec::new(),
        };
        for site in graph.order.iter().rev() {
            let above = machine.height[*site as usize] + 1;
            for wire in graph.wires_of(*site) {
                let from = &mut machine.height[graph.site_of[wire.from as usize] as usize];
                *from = above.max(*from);
            }
        }
        machine
    }

    /// Slots of the outputs that are asked for.
    pub fn targets(&self) -> Vec<u32> {
        self.graph
            .outputs()
            .iter()
            .filter(|output| self.run.asks_for(&output.name))
            .map(|output| output.slot)
            .collect()
    }

    /// Marks what may be needed, and asks for the outputs.
    pub fn start(&mut self) {
        let targets = self.targets();
        let mut stack = targets.clone();
        while let Some(slot) = stack.pop() {
            if std::mem::replace(&mut self.slots[slot as usize].alive, true) {
                continue;
            }
            for wire in self.graph.wires_of(self.graph.site_of[slot as usize]) {
                self.slots[wire.from as usize].readers += 1;
                stack.push(wire.from);
            }
        }
        for slot in targets {
            self.slots[slot as usize].pinned = true;
            self.request(slot);
        }
    }

    /// Works until nothing can be decided without a job coming back.
    pub fn settle_agenda(&mut self) {
        while let Some(slot) = self.agenda.pop() {
            match self.slots[slot as usize].phase {
                Phase::Requested if (slot as usize) < self.graph.inputs().len() => self.begin_input(slot),
                Phase::Requested => {
                    let (always, _) = self.wired(slot);
                    self.ask(slot, always);
                }
                Phase::Digests => self.look_up(slot),
                Phase::Again => self.begin_again(slot),
                _ => {}
            }
        }
    }

    fn slot(&mut self, slot: u32) -> &mut SlotState {
        &mut self.slots[slot as usize]
    }

    fn site_of(&self, slot: u32) -> u32 {
        self.graph.site_of[slot as usize]
    }

    /// The wires into a slot's site at some ports; absent inputs wire nothing.
    pub fn wires(&self, slot: u32, ports: u64) -> impl Iterator<Item = Wire> + use<'r> {
        let absent = Arc::clone(&self.absent);
        self.graph
            .wires_of(self.site_of(slot))
            .iter()
            .copied()
            .filter(move |wire| {
                ports & (1 << wire.port) != 0 && !absent.get(wire.from as usize).copied().unwrap_or(false)
            })
    }

    fn ports(&self, slot: u32) -> &'r [PortSpec] {
        self.graph
            .node_at(self.site_of(slot))
            .map_or(&[], |node| &node.spec.inputs)
    }

    /// Ports that something is wired to, as bits: (always needed, lazy).
    pub fn wired(&self, slot: u32) -> (u64, u64) {
        let ports = self.ports(slot);
        self.wires(slot, u64::MAX).fold((0, 0), |(always, lazy), wire| {
            let bit = 1 << wire.port;
            if ports[usize::from(wire.port)].lazy {
                (always, lazy | bit)
            } else {
                (always | bit, lazy)
            }
        })
    }
}
