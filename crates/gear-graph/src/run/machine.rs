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

use std::collections::BinaryHeap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::inputs::{Given, Source};
use super::jobs::{Computed, Job, Trouble};
use super::report::{Failure, FailureKind, InputSummary};
use super::{Run, keys};
use crate::graph::Wire;
use crate::node::KnownPort;
use crate::store::{Done, Need, Record, Store};
use crate::{AnyValue, Demand, Digest, Graph, Known, NodeError, PortSpec, Slot, Want};

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
            .filter(|output| {
                self.run
                    .outputs
                    .as_ref()
                    .is_none_or(|names| names.contains(&output.name))
            })
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

    // ---- digests -------------------------------------------------------------------------------------------------

    /// Somebody needs the digest of a slot.
    pub fn request(&mut self, slot: u32) {
        let state = self.slot(slot);
        if state.phase == Phase::Idle {
            state.phase = Phase::Requested;
            self.agenda.push(slot);
            self.begun.push(slot);
        }
    }

    /// Whether the digest of a slot is known.
    fn known(&self, slot: u32) -> bool {
        let state = &self.slots[slot as usize];
        state.phase == Phase::Done || state.again
    }

    fn begin_input(&mut self, slot: u32) {
        let input = &self.graph.inputs()[slot as usize];
        match &self.given[slot as usize] {
            // Nobody asks for what is absent, except an output that is an optional input.
            Given::Absent => {
                self.fail(slot, Trouble::Error(NodeError::new("the optional input was not given")));
            }
            Given::Value(value) => {
                let value = value.clone();
                let digest = value.digest();
                self.slot(slot).pinned = true;
                self.done(slot, digest);
                self.set_value(slot, value);
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
    fn ask(&mut self, slot: u32, ports: u64) {
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
    fn look_up(&mut self, slot: u32) {
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
    fn base(&mut self, slot: u32) -> (Digest, Option<Digest>) {
        let site = self.site_of(slot);
        if let Some(base) = self.sites[site as usize].base {
            return base;
        }
        let Some(node) = self.graph.node_at(site) else {
            return Default::default();
        };
        let of = |realm: &str| keys::of_node(node, realm, self.run.elision);
        let realm = node.node.realm();
        let base = (of(&realm), (realm != "cpu").then(|| of("cpu")));
        self.sites[site as usize].base = Some(base);
        base
    }

    /// What the store knows at a key, unless it must not be asked.
    fn find(&self, slot: u32, key: &Digest) -> Option<Record> {
        let site = self.site_of(slot);
        if self.run.fresh.contains(self.graph.site_name(site)) {
            return None;
        }
        if !self.cacheable(slot) {
            return None;
        }
        self.store.as_ref()?.lookup(key)
    }

    /// Whether the value with this digest can be had from the store.
    pub fn stored(&self, value: &Digest) -> bool {
        self.store.as_ref().is_some_and(|store| store.has_value(value))
    }

    fn cacheable(&self, slot: u32) -> bool {
        self.graph
            .node_at(self.site_of(slot))
            .is_none_or(|node| node.spec.deterministic)
    }

    /// The bits of ports that may be asked for by these names; `None` if one may not.
    fn needed<S: AsRef<str>>(&self, slot: u32, names: &[S]) -> Option<u64> {
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

    // ---- demand --------------------------------------------------------------------------------------------------

    /// Nothing is known at the key: ask the node, first without values.
    fn decide(&mut self, slot: u32) {
        let (_, lazy) = self.wired(slot);
        let open = lazy & !self.slots[slot as usize].demanded;
        if open == 0 {
            self.want_values(slot, Phase::ValuesToRun);
            return;
        }
        if !self.run.elision {
            self.ask(slot, open);
            return;
        }
        match self.demand_unseen(slot, self.slots[slot as usize].demanded) {
            Err(NodeError::Unknown { .. }) => self.want_values(slot, Phase::ValuesToDecide),
            Ok(demand) => self.decided(slot, Ok(demand)),
            Err(error) => self.decided(slot, Err(Trouble::Error(error))),
        }
    }

    /// What the node demands, asked without letting it see any value: `Unknown` if it wants to.
    pub fn demand_unseen(&self, slot: u32, demanded: u64) -> Result<Demand, NodeError> {
        let unknown = || NodeError::Unknown { port: String::new() };
        let Some(node) = self.graph.node_at(self.site_of(slot)) else {
            return Ok(Demand::ready());
        };
        let known = Known::new(self.known_ports(slot, demanded), Box::new(move |_| Err(unknown())));
        let answer = AssertUnwindSafe(|| node.node.demand(self.graph.port_name(slot), &known));
        // After a panic, ask again where panics are caught with their message.
        catch_unwind(answer).unwrap_or_else(|_| Err(unknown()))
    }

    fn known_ports(&self, slot: u32, demanded: u64) -> Vec<KnownPort> {
        let (always, lazy) = self.wired(slot);
        self.ports(slot)
            .iter()
            .enumerate()
            .map(|(i, port)| KnownPort {
                name: port.name,
                lazy: port.lazy,
                wired: (always | lazy) & (1 << i) != 0,
                known: demanded & (1 << i) != 0,
            })
            .collect()
    }

    /// The node has answered.
    pub fn decided(&mut self, slot: u32, answer: Result<Demand, Trouble>) {
        match answer {
            Err(trouble) => self.fail(slot, trouble),
            Ok(Demand::Ready { reason }) => {
                self.slot(slot).reason = reason.into();
                self.want_values(slot, Phase::ValuesToRun);
            }
            Ok(Demand::Need { ports, reason }) => match self.needed(slot, &ports) {
                Some(bits) => {
                    if let (Some(key), true) = (self.slots[slot as usize].key, self.cacheable(slot)) {
                        self.publish(Record::Need(Need {
                            key,
                            ports: ports.iter().map(ToString::to_string).collect(),
                            reason: reason.into(),
                        }));
                    }
                    self.ask(slot, bits);
                }
                None => self.fail(
                    slot,
                    Trouble::Error(NodeError::new(format!(
                        "`demand` asks for {ports:?}; it may ask only for lazy ports that are wired and not known yet, \
                         and for at least one"
                    ))),
                ),
            },
        }
    }

    // ---- values --------------------------------------------------------------------------------------------------

    /// Waits for the values at all demanded ports.
    fn want_values(&mut self, slot: u32, then: Phase) {
        let demanded = self.slots[slot as usize].demanded;
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

    fn values_there(&mut self, slot: u32) {
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

    fn queue(&mut self, slot: u32) {
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
        let digest = state.digest;
        if self.store.is_some() && self.cacheable(slot) {
            self.slot(slot).loading = true;
            self.urgent.push(Job::Load {
                slot,
                digest,
                value_type: self.graph.slot_type(slot),
            });
        } else {
            self.run_again(slot);
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
    fn run_again(&mut self, slot: u32) {
        let state = self.slot(slot);
        state.again = true;
        state.phase = Phase::Again;
        self.begun.push(slot);
        for wire in self.graph.wires_of(self.site_of(slot)) {
            self.slots[wire.from as usize].readers += 1;
        }
        self.agenda.push(slot);
    }

    fn begin_again(&mut self, slot: u32) {
        if (slot as usize) < self.graph.inputs().len() {
            self.queue(slot);
        } else {
            self.want_values(slot, Phase::ValuesToRun);
        }
    }

    fn set_value(&mut self, slot: u32, value: AnyValue) {
        let state = self.slot(slot);
        state.bytes = value.size_bytes() as u64;
        state.value = Some(value);
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

    fn drop_if_unread(&mut self, slot: u32) {
        let cacheable = self.cacheable(slot);
        let state = self.slot(slot);
        // What is not cached cannot be had again with the same bits: it stays until the end.
        if state.readers == 0 && !state.pinned && cacheable {
            state.value = None;
        }
    }

    // ---- running -------------------------------------------------------------------------------------------------

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
                    return Some(Job::LoadInput {
                        slot,
                        loader: Arc::clone(loader),
                        source: Source::clone(source),
                        value_type: input.value_type,
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

    fn computed(&mut self, slot: u32, computed: Computed, seconds: f64, peak: u64, notes: &[String]) {
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
            let state = self.slot(slot);
            state.bytes = value.size_bytes() as u64;
            state.value = Some(value);
            self.done(slot, digest);
            self.drop_if_unread(slot);
        }
    }

    fn record(&self, slot: u32, value: &AnyValue, digest: Digest, seconds: f64, peak: u64, notes: &[String]) -> Done {
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

    fn publish(&self, record: Record) {
        if let Some(store) = &self.store {
            store.publish(record);
        }
    }

    // ---- ends ----------------------------------------------------------------------------------------------------

    fn hit(&mut self, slot: u32, done: Done) {
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

    fn note(&mut self, site: u32, notes: &[String]) {
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
    fn done(&mut self, slot: u32, digest: Digest) {
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
        if self.run.values && self.slots[slot as usize].pinned {
            self.request_value(slot);
        }
    }

    /// A slot is settled: it reads its inputs no more. Those that nobody else reads are dropped or dead.
    fn release(&mut self, slot: u32) {
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

    fn fail_all(&mut self, slots: &[u32], trouble: Trouble) {
        if let Some(first) = slots.first() {
            self.fail(*first, trouble);
        }
        for slot in slots.iter().skip(1) {
            let site = self.site_of(*slot);
            self.failed(*slot, site);
        }
    }

    fn fail(&mut self, slot: u32, trouble: Trouble) {
        let site = self.site_of(slot);
        let interrupted = self.run.cancel.load(std::sync::atomic::Ordering::Relaxed);
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

    fn skip(&mut self, slot: u32, because_of: u32) {
        let by_site = self.site_of(because_of);
        let root = self.sites[by_site as usize].skipped_by.unwrap_or(by_site);
        self.failed(slot, root);
    }

    /// A slot will never be known; nor will those that wait for it, and so on. `root` is the site that failed first.
    fn failed(&mut self, slot: u32, root: u32) {
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
