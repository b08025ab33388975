//! What a run leaves: its record, and its outputs.

use super::inputs::Given;
use super::machine::{Machine, Phase};
use super::report::{
    ElidedPort, MemoryReport, NodeReport, NodeStatus, OutputReport, PortReport, RunReport, RunStatus, StoreReport,
};
use super::scheduler::Spent;
use super::{Run, memory};
use crate::{AnyValue, Digest};

/// What a run leaves.
pub struct Outcome<'g> {
    /// The record of the run.
    pub report: RunReport,
    run: Run<'g>,
    outputs: Vec<OutputState>,
}

struct OutputState {
    name: String,
    digest: Option<Digest>,
    value: Option<AnyValue>,
}

impl Outcome<'_> {
    /// The digest of an output's value; `None` if it failed, was not asked for or does not exist.
    pub fn digest(&self, output: &str) -> Option<Digest> {
        self.output(output)?.digest
    }

    /// The value of an output: from memory, from the store, or computed again if the store lost it. `None` if it
    /// failed, was not asked for or does not exist.
    pub fn value(&self, output: &str) -> Option<AnyValue> {
        self.value_at_hand(output)
            .or_else(|| self.computed_again(output)?.value_at_hand(output))
    }

    /// The same; the record of the run then tells also what was computed again for it.
    pub fn recover(&mut self, output: &str) -> Option<AnyValue> {
        if let Some(value) = self.value_at_hand(output) {
            return Some(value);
        }
        let again = self.computed_again(output)?;
        self.report.add(&again.report);
        again.value_at_hand(output)
    }

    /// The value of an output, if nothing must be computed for it.
    fn value_at_hand(&self, output: &str) -> Option<AnyValue> {
        let state = self.output(output)?;
        let digest = state.digest?;
        if let Some(value) = &state.value {
            return Some(value.clone());
        }
        let graph = self.run.graph;
        let slot = graph.outputs().iter().find(|o| o.name == output)?.slot;
        self.run.store.as_ref()?.load(&digest, &graph.slot_type(slot))
    }

    /// A run of one output whose value was lost.
    fn computed_again(&self, output: &str) -> Option<Self> {
        self.digest(output)?;
        self.run.clone().outputs([output]).with_values().go().ok()
    }

    fn output(&self, name: &str) -> Option<&OutputState> {
        self.outputs.iter().find(|output| output.name == name)
    }
}

impl std::fmt::Debug for Outcome<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Outcome({:?})", self.report.status)
    }
}

pub(super) fn finish<'g>(run: &Run<'g>, machine: Machine<'_>, spent: &Spent, interrupted: bool) -> Outcome<'g> {
    let targets = machine.targets();
    let complete = targets
        .iter()
        .all(|slot| machine.slots[*slot as usize].phase == Phase::Done);
    let status = if interrupted && !complete {
        RunStatus::Interrupted
    } else if complete && machine.failures.is_empty() {
        RunStatus::Done
    } else {
        RunStatus::Failed
    };
    let did_without = |slot: u32, port: u16| {
        let state = &machine.slots[slot as usize];
        if state.phase == Phase::Done && state.demanded & (1 << port) == 0 {
            DidWithout::because(&state.reason)
        } else {
            DidWithout::No
        }
    };
    let left_out = why_left_out(&machine, &did_without, &|_| false);
    let graph = run.graph;
    let nodes = graph
        .order
        .iter()
        .map(|site| node_report(&machine, *site, &left_out))
        .collect();
    let outputs: Vec<_> = graph
        .outputs()
        .iter()
        .filter(|output| run.asks_for(&output.name))
        .map(|output| {
            let slot = &machine.slots[output.slot as usize];
            let done = slot.phase == Phase::Done;
            OutputState {
                name: output.name.clone(),
                digest: done.then_some(slot.digest),
                value: slot.value.clone().filter(|_| done),
            }
        })
        .collect();
    let seconds = spent.started.map_or(0.0, |started| started.elapsed().as_secs_f64());
    // Not the clock's time where it can be helped: a busy machine would be taken for work.
    let framework_seconds = match (spent.worked, memory::thread_seconds()) {
        (Some(before), Some(now)) => now - before,
        _ => seconds - spent.inputs - spent.waiting,
    };
    let report = RunReport {
        version: env!("CARGO_PKG_VERSION"),
        id: format!("{:016x}", machine.id),
        graph: graph.name().to_string(),
        status,
        seconds,
        node_seconds: machine.sites.iter().map(|site| site.seconds).sum(),
        framework_seconds,
        peak_memory: memory::peak_memory(),
        memory: MemoryReport {
            limit: run.memory,
            estimated_peak: spent.estimated,
            held_back: spent.held_back,
        },
        jobs: spent.threads,
        elision: run.elision,
        store: StoreReport {
            folder: run.store.as_ref().map(|store| store.path().display().to_string()),
            hash_seconds: spent.inputs + spent.store.hash,
            write_seconds: spent.store.write,
            read_seconds: spent.store.read,
        },
        nodes,
        outputs: outputs
            .iter()
            .zip(&targets)
            .map(|(output, slot)| OutputReport {
                name: output.name.clone(),
                source: graph.slot_name(*slot),
                type_name: graph.slot_type(*slot).name,
                digest: output.digest.map(|digest| digest.hex()),
            })
            .collect(),
        failures: machine.failures,
        warnings: machine.warnings,
    };
    Outcome {
        report,
        run: run.clone(),
        outputs,
    }
}

/// Whether a slot does without one of its site's ports, and why.
pub(super) enum DidWithout {
    Yes(String),
    No,
}

impl DidWithout {
    /// For the reason that `demand` gave, if it gave one.
    pub fn because(reason: &str) -> Self {
        Self::Yes(reason_or_default(reason))
    }
}

fn reason_or_default(reason: &str) -> String {
    let reason = if reason.is_empty() {
        "its result does not depend on it"
    } else {
        reason
    };
    reason.to_string()
}

/// For every site of which nothing is requested, why. Consumers come first, so that their reasons are known.
pub(super) fn why_left_out(
    machine: &Machine<'_>,
    did_without: &dyn Fn(u32, u16) -> DidWithout,
    requested: &dyn Fn(u32) -> bool,
) -> Vec<Option<String>> {
    let graph = machine.graph;
    let mut why: Vec<Option<String>> = vec![None; graph.sites()];
    for site in graph.order.iter().rev() {
        let idle = |slot: u32| matches!(machine.slots[slot as usize].phase, Phase::Idle | Phase::Dead);
        if !graph.slots_of(*site).all(|slot| idle(slot) && !requested(slot)) {
            continue;
        }
        let mut reason = "no output that was asked for needs it".to_string();
        let alive = graph.slots_of(*site).filter(|slot| machine.slots[*slot as usize].alive);
        for reading in alive.flat_map(|slot| graph.readers_of(slot)) {
            let reader = graph.site_name(reading.site);
            let because = graph
                .slots_of(reading.site)
                .find_map(|slot| match did_without(slot, reading.port) {
                    DidWithout::Yes(because) => Some(because),
                    DidWithout::No => None,
                });
            if let (Some(because), Some(node)) = (because, graph.node_at(reading.site)) {
                let port = node.spec.inputs[usize::from(reading.port)].name;
                reason = format!("`{reader}` does without `{port}`: {because}");
                break;
            }
            if why[reading.site as usize].is_some() {
                reason = format!("only `{reader}` would read it, which is left out");
            }
        }
        why[*site as usize] = Some(reason);
    }
    why
}

fn node_report(machine: &Machine<'_>, site: u32, left_out: &[Option<String>]) -> NodeReport {
    let graph = machine.graph;
    let state = &machine.sites[site as usize];
    let node = graph.node_at(site);
    let slots: Vec<u32> = graph.slots_of(site).collect();
    let phases = || slots.iter().map(|slot| machine.slots[*slot as usize].phase);
    let given = machine.given.get(site as usize);
    let optional = graph.inputs().get(site as usize).is_some_and(|input| input.optional);
    let mut reason = None;
    let status = if state.failed {
        NodeStatus::Failed
    } else if let Some(by) = state.skipped_by {
        reason = Some(format!("`{}` failed", graph.site_name(by)));
        NodeStatus::Skipped
    } else if optional && matches!(given, Some(Given::Absent)) {
        NodeStatus::NotGiven
    } else if matches!(given, Some(Given::Value(_))) {
        NodeStatus::Given
    } else if let Some(why) = &left_out[site as usize] {
        reason = Some(why.clone());
        NodeStatus::LeftOut
    } else if state.ran {
        NodeStatus::Ran
    } else if phases().all(|phase| matches!(phase, Phase::Done | Phase::Idle | Phase::Dead)) {
        NodeStatus::Cached
    } else {
        NodeStatus::Unfinished
    };
    let (params, type_name, version, numerics, realm) = match node {
        Some(node) => (
            node.params(),
            node.spec.name,
            node.spec.version,
            node.spec.numerics.clone(),
            node.node.realm(&machine.run.resources),
        ),
        None => {
            let input = &graph.inputs()[site as usize];
            let loader = input.loader.as_deref();
            (
                input.params(),
                input.value_type.name,
                loader.map_or(0, |loader| loader.version),
                loader.map(|loader| loader.numerics.clone()).unwrap_or_default(),
                "cpu".to_string(),
            )
        }
    };
    NodeReport {
        id: graph.site_name(site).to_string(),
        type_name: type_name.to_string(),
        input: node.is_none(),
        status,
        reason,
        node_version: version,
        numerics,
        realm,
        deterministic: node.is_none_or(|node| node.spec.deterministic),
        source: match given {
            Some(Given::Source { source, .. }) => Some(source.name()),
            _ => None,
        },
        params,
        seconds: if state.ran { state.seconds } else { state.saved },
        peak_memory: state.peak,
        notes: state.notes.clone(),
        outputs: slots
            .iter()
            .filter(|slot| !matches!(machine.slots[**slot as usize].phase, Phase::Idle | Phase::Dead))
            .map(|slot| {
                let state = &machine.slots[*slot as usize];
                PortReport {
                    port: graph.port_name(*slot).to_string(),
                    type_name: graph.slot_type(*slot).name,
                    hit: state.hit,
                    key: state.key.map(|key| key.hex()),
                    digest: (state.phase == Phase::Done).then(|| state.digest.hex()),
                    bytes: state.bytes,
                }
            })
            .collect(),
        elided: slots.iter().flat_map(|slot| elided(machine, *slot)).collect(),
    }
}

/// The lazy ports that are wired and were not demanded for an output that is done.
fn elided(machine: &Machine<'_>, slot: u32) -> Vec<ElidedPort> {
    let graph = machine.graph;
    let state = &machine.slots[slot as usize];
    let Some(node) = graph.node_at(graph.site_of[slot as usize]) else {
        return Vec::new();
    };
    if state.phase != Phase::Done {
        return Vec::new();
    }
    let (_, lazy) = machine.wired(slot);
    let ports = node.spec.inputs.iter().enumerate();
    ports
        .filter(|(i, _)| lazy & !state.demanded & (1 << i) != 0)
        .map(|(_, port)| ElidedPort {
            output: graph.port_name(slot).to_string(),
            port: port.name.to_string(),
            reason: reason_or_default(&state.reason),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_left_out_always_has_a_reason() {
        assert_eq!(reason_or_default("beta = 0"), "beta = 0");
        assert!(!reason_or_default("").is_empty());
    }
}
