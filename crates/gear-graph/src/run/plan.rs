//! What a run would do, found without computing anything.
//!
//! The machine plans as it does in a run, only no job is ever carried out. What must run has no digest then, and
//! what reads it cannot be looked up: it is taken to run, although it may turn out to be cut off early. What such a
//! node would demand is asked of it without values; when it wants to see values first, what only it would read
//! *may* run.

use std::collections::BTreeMap;

use serde::Serialize;

use super::inputs::Given;
use super::jobs::Job;
use super::machine::{Machine, Phase};
use super::outcome::{DidWithout, why_left_out};
use super::{ElidedPort, Run};
use crate::{Demand, NodeError};

/// What a run would do, producers first.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// The inputs and nodes.
    pub nodes: Vec<PlannedNode>,
}

/// What would become of a node or input.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedNode {
    /// Its id, or the input's name.
    pub id: String,
    /// Its type.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Whether it is a graph input.
    pub input: bool,
    /// What would become of it.
    pub state: PlannedState,
    /// Why.
    pub reason: String,
    /// Whether equal inputs give equal bits; what is not so is stored only when asked for.
    pub deterministic: bool,
    /// Seconds that it took when it was computed last, if it is stored.
    pub seconds: Option<f64>,
    /// Wired ports that would not be needed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub elided: Vec<ElidedPort>,
}

/// What would become of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlannedState {
    /// It runs (unless all that it reads turns out to have values that it was run with before).
    Runs,
    /// It runs if a node asks for it that wants to see values first.
    MayRun,
    /// Everything needed of it is stored.
    Cached,
    /// Nothing of it is needed; an input that nothing needs may be missing.
    LeftOut,
    /// An input given as a value.
    Given,
    /// An optional input that is not given.
    NotGiven,
}

impl Plan {
    /// The node or input of that name.
    pub fn node(&self, id: &str) -> Option<&PlannedNode> {
        self.nodes.iter().find(|node| node.id == id)
    }
}

/// What was found out about the demand of a slot that has no digest.
struct Decided {
    /// Ports that it demands.
    demanded: u64,
    /// Ports that it may demand when it sees values.
    open: u64,
    reason: String,
}

pub(super) fn plan(run: &Run<'_>, given: &[Given]) -> Plan {
    planned(run, given).report()
}

/// Plans as far as it gets without computing anything.
pub(super) fn planned<'r>(run: &'r Run<'r>, given: &[Given]) -> Planner<'r> {
    let mut planner = Planner {
        machine: Machine::new(run, given.to_vec()),
        decided: BTreeMap::new(),
    };
    planner.machine.start();
    planner.settle();
    planner
}

pub(super) struct Planner<'r> {
    pub machine: Machine<'r>,
    decided: BTreeMap<u32, Decided>,
}

impl Planner<'_> {
    /// Lets the machine go as far as it gets without values, and guesses what comes after, until nothing is new.
    fn settle(&mut self) {
        let mut from = 0;
        loop {
            self.machine.settle_agenda();
            while let Some(job) = self.machine.urgent.pop() {
                if let Job::Load { slot, digest, .. } = job
                    && !self.machine.stored(&digest)
                {
                    self.machine.loaded(slot, None);
                }
            }
            self.machine.settle_agenda();
            if from == self.machine.begun.len() && self.machine.urgent.is_empty() {
                return;
            }
            let begun = self.machine.begun.split_off(from);
            self.machine.begun.extend(&begun);
            from = self.machine.begun.len();
            for slot in begun {
                if !pending(self.machine.slots[slot as usize].phase) || self.decided.contains_key(&slot) {
                    continue;
                }
                let decided = self.decide(slot);
                for wire in self.machine.wires(slot, decided.demanded) {
                    self.machine.request(wire.from);
                }
                self.decided.insert(slot, decided);
            }
        }
    }

    fn decide(&self, slot: u32) -> Decided {
        let machine = &self.machine;
        let (always, lazy) = machine.wired(slot);
        let mut demanded = always | machine.slots[slot as usize].demanded;
        let mut reason = machine.slots[slot as usize].reason.to_string();
        let Some(node) = machine.graph.node_at(machine.graph.site_of[slot as usize]) else {
            return Decided {
                demanded,
                open: 0,
                reason,
            };
        };
        if !machine.run.elision {
            demanded |= lazy;
        }
        while lazy & !demanded != 0 && machine.slots[slot as usize].phase != Phase::Queued {
            match machine.demand_unseen(slot, demanded) {
                Ok(Demand::Need { ports, .. }) => {
                    let bits = ports
                        .iter()
                        .filter_map(|name| node.spec.inputs.iter().position(|port| port.name == *name))
                        .fold(0u64, |bits, port| bits | 1 << port);
                    if bits & lazy & !demanded == 0 {
                        break; // the run will report what is wrong with this
                    }
                    demanded |= bits & lazy;
                }
                Ok(Demand::Ready { reason: because }) => {
                    reason = because.into();
                    break;
                }
                Err(NodeError::Unknown { .. }) => {
                    return Decided {
                        demanded,
                        open: lazy & !demanded,
                        reason,
                    };
                }
                Err(_) => break,
            }
        }
        Decided {
            demanded,
            open: 0,
            reason,
        }
    }

    pub fn report(&self) -> Plan {
        let machine = &self.machine;
        let graph = machine.graph;
        // What an undecided demand may want, and all before it that is not wanted anyway; by whom.
        let mut may: BTreeMap<u32, u32> = BTreeMap::new();
        for (slot, decided) in &self.decided {
            let mut stack: Vec<u32> = machine.wires(*slot, decided.open).map(|wire| wire.from).collect();
            while let Some(at) = stack.pop() {
                if matches!(machine.slots[at as usize].phase, Phase::Idle) && !may.contains_key(&at) {
                    may.insert(at, graph.site_of[*slot as usize]);
                    stack.extend(machine.wires(at, u64::MAX).map(|wire| wire.from));
                }
            }
        }
        let did_without = |slot: u32, port: u16| -> DidWithout {
            let state = &machine.slots[slot as usize];
            match (self.decided.get(&slot), state.phase) {
                (Some(decided), _) if (decided.demanded | decided.open) & (1 << port) == 0 => {
                    DidWithout::because(&decided.reason)
                }
                (None, Phase::Done) if state.demanded & (1 << port) == 0 => DidWithout::because(&state.reason),
                _ => DidWithout::No,
            }
        };
        let left_out = why_left_out(machine, &did_without, &|slot| may.contains_key(&slot));
        let nodes = graph
            .order
            .iter()
            .map(|site| self.node(*site, &may, left_out[*site as usize].as_deref(), &did_without))
            .collect();
        Plan { nodes }
    }

    fn node(
        &self,
        site: u32,
        may: &BTreeMap<u32, u32>,
        left_out: Option<&str>,
        did_without: &dyn Fn(u32, u16) -> DidWithout,
    ) -> PlannedNode {
        let machine = &self.machine;
        let graph = machine.graph;
        let slots = graph.slots_of(site);
        let phase = |slot: u32| machine.slots[slot as usize].phase;
        let optional = graph.inputs().get(site as usize).is_some_and(|input| input.optional);
        let (state, reason) = if let (Some(Given::Absent), true) = (machine.given.get(site as usize), optional) {
            (PlannedState::NotGiven, String::new())
        } else if let Some(Given::Value(_)) = machine.given.get(site as usize) {
            (PlannedState::Given, String::new())
        } else if let Some(slot) = slots.clone().find(|slot| pending(phase(*slot))) {
            (PlannedState::Runs, self.why_it_runs(slot))
        } else if slots.clone().any(|slot| phase(slot) == Phase::Done) {
            (PlannedState::Cached, "stored".to_string())
        } else if let Some(by) = slots.clone().find_map(|slot| may.get(&slot)) {
            (
                PlannedState::MayRun,
                format!("if `{}` asks for it, which looks at values first", graph.site_name(*by)),
            )
        } else {
            (PlannedState::LeftOut, left_out.unwrap_or_default().to_string())
        };
        let (type_name, specs) = match graph.node_at(site) {
            Some(node) => (node.spec.name, &node.spec.inputs[..]),
            None => (graph.inputs()[site as usize].value_type.name, &[][..]),
        };
        let saved = machine.sites[site as usize].saved;
        let elided = slots
            .filter(|slot| pending(phase(*slot)) || phase(*slot) == Phase::Done)
            .flat_map(|slot| specs.iter().enumerate().map(move |(port, spec)| (slot, port, spec)))
            .filter(|(slot, port, spec)| spec.lazy && machine.wired(*slot).1 & (1 << port) != 0)
            .filter_map(|(slot, port, spec)| match did_without(slot, port as u16) {
                DidWithout::Yes(reason) => Some(ElidedPort {
                    output: graph.port_name(slot).to_string(),
                    port: spec.name.to_string(),
                    reason,
                }),
                DidWithout::No => None,
            })
            .collect();
        PlannedNode {
            id: graph.site_name(site).to_string(),
            type_name: type_name.to_string(),
            input: graph.node_at(site).is_none(),
            state,
            reason,
            deterministic: graph.node_at(site).is_none_or(|node| node.spec.deterministic),
            seconds: (saved > 0.0).then_some(saved),
            elided,
        }
    }

    /// What makes a slot run whatever its inputs are.
    pub fn own_reason(&self, slot: u32) -> Option<&'static str> {
        let machine = &self.machine;
        let site = machine.graph.site_of[slot as usize];
        if machine.run.fresh.contains(machine.graph.site_name(site)) {
            Some("it was asked to run afresh")
        } else if !machine.cacheable(slot) {
            Some("it is not deterministic, so it is not stored")
        } else if machine.slots[slot as usize].again {
            Some("its value is needed, and is not in the store any more")
        } else {
            None
        }
    }

    /// The ports that a slot demands for certain, and those that it may demand when it sees values.
    pub fn demand_of(&self, slot: u32) -> (u64, u64) {
        let demanded = self.machine.slots[slot as usize].demanded;
        match self.decided.get(&slot) {
            Some(decided) => (demanded | decided.demanded, decided.open & !demanded),
            None => (demanded, 0),
        }
    }

    fn why_it_runs(&self, slot: u32) -> String {
        let machine = &self.machine;
        let graph = machine.graph;
        let state = &machine.slots[slot as usize];
        if let Some(reason) = self.own_reason(slot) {
            return reason.to_string();
        }
        let mut before: Vec<_> = machine
            .wires(slot, state.demanded)
            .filter(|wire| pending(machine.slots[wire.from as usize].phase) && !machine.slots[wire.from as usize].again)
            .map(|wire| graph.site_name(graph.site_of[wire.from as usize]))
            .collect();
        before.dedup();
        // What comes first may turn out as it was: then this does not run.
        let (one_stops, some_stop) = match machine.run.store {
            Some(_) => (
                ", unless that gives what it gave before",
                ", unless they give what they gave before",
            ),
            None => ("", ""),
        };
        match before.as_slice() {
            [] if machine.run.store.is_none() => "there is no store".to_string(),
            [] => "nothing is stored for its inputs, parameters and version".to_string(),
            [one] => format!("after `{one}`{one_stops}"),
            [some @ .., last] => format!("after `{}` and `{last}`{some_stop}", some.join("`, `")),
        }
    }
}

/// Whether a slot in this phase has to run.
pub(super) fn pending(phase: Phase) -> bool {
    matches!(
        phase,
        Phase::Digests | Phase::ValuesToDecide | Phase::ValuesToRun | Phase::Deciding | Phase::Queued | Phase::Again
    )
}
