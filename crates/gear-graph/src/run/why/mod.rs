//! Why an output runs, or where its stored value came from.
//!
//! # How it works
//!
//! The planner says what would become of the output, and what its key is made of as far as that is known without
//! computing anything. The store says what every key was made of that was ever computed into it (its *origins*). The
//! parts of this key are compared with those of the nearest origin:
//!
//! 1. those of the same node and output in a graph of the same name; if there is none,
//! 2. those of other nodes of the same type;
//! 3. among them the one that differs in the fewest parts; among equals the latest.
//!
//! When the value is stored, its own origin says which run computed it, and is compared with the nearest origin
//! *before* it: that is why it was computed then.
//!
//! An input that must be computed first has no digest yet. It is told as such, with the reasons of the nodes at which
//! the change begins: those that run although everything that they read is known.

mod text;

use std::collections::BTreeSet;

use serde::Serialize;
use serde_json::Value as Json;

use super::inputs::{Given, RunMistake};
use super::machine::{Machine, Phase};
use super::plan::{Planner, pending, planned};
use super::{PlannedState, Run};
use crate::graph::nearest;
use crate::store::{Origin, Parts};
use crate::{Digest, Summary};

/// Ahead of a node, at most so many beginnings of a change are told.
const AHEAD: usize = 5;

/// Why some outputs of a node run, or where their stored values came from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Why {
    /// The node's id, or the input's name.
    pub node: String,
    /// Its type.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Its outputs of which this is said.
    pub outputs: Vec<String>,
    /// What would become of it.
    pub state: PlannedState,
    /// Why, as the plan says it.
    pub reason: String,
    /// The run that computed the value under this very key.
    pub computed: Option<EarlierRun>,
    /// The nearest other run of the action before that.
    pub nearest: Option<EarlierRun>,
    /// In what the key differs from that of the nearest run.
    pub differences: Vec<Difference>,
    /// What is not known before other nodes have run.
    pub ahead: Vec<WhyAhead>,
}

/// A run that computed something, as far as the store remembers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EarlierRun {
    /// Identifies the run; `id` in its record.
    pub run: String,
    /// When, in seconds since 1970.
    pub made: u64,
    /// Seconds that the node took.
    pub seconds: f64,
    /// The graph, as it was named.
    pub graph: String,
    /// The node, in that graph.
    pub node: String,
}

/// A part of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// A parameter.
    Parameter,
    /// What is at an input port, or the file of an input.
    Input,
    /// The node's type.
    Type,
    /// The version of the node or loader.
    Version,
    /// The numerics of a crate.
    Numerics,
    /// Where the bits are valid.
    Realm,
    /// Whether elisions are on.
    Elision,
}

/// A part of a key that is another than it was.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Which part.
    pub part: Part,
    /// The parameter, the port, the crate.
    pub name: String,
    /// What it was; none if it was no part of the key.
    pub old: Option<String>,
    /// What it is; none if it is no part of the key any more.
    pub new: Option<String>,
    /// Of an input: where its value comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Of an input whose old and new values are stored: in what their summaries differ.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub summary: Vec<(String, String, String)>,
}

/// An input of which not all is known before another node has run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WhyAhead {
    /// The port.
    pub port: String,
    /// Where its value comes from.
    pub source: String,
    /// Whether the input is asked for, and only its value is not known; else values decide whether it is.
    pub certain: bool,
    /// The nodes at which the change begins, each with its reason.
    pub begins: Vec<(String, String)>,
}

pub(super) fn why(run: &Run<'_>, given: &[Given], name: &str) -> Result<Vec<Why>, RunMistake> {
    let planner = planned(run, given);
    let graph = run.graph;
    let (site, port) = find(graph, name)?;
    let origins = run.store.as_ref().map(|store| store.origins()).unwrap_or_default();
    let explainer = Explainer {
        planner: &planner,
        origins: &origins,
    };
    let plan = planner.report();
    let node = plan.node(graph.site_name(site));
    let (state, reason) = node.map_or((PlannedState::LeftOut, ""), |node| (node.state, node.reason.as_str()));
    let slots: Vec<u32> = graph
        .slots_of(site)
        .filter(|slot| port.is_none_or(|port| port == *slot))
        .collect();
    let mut all: Vec<Why> = Vec::new();
    for slot in slots {
        let phase = planner.machine.slots[slot as usize].phase;
        let needed = pending(phase) || phase == Phase::Done;
        if !needed && port.is_none() && matches!(state, PlannedState::Runs | PlannedState::Cached) {
            continue; // nobody asks for this output
        }
        let mut one = explainer.why(slot);
        (one.state, one.reason) = match (needed, state) {
            (true, PlannedState::Runs) if !pending(phase) => (PlannedState::Cached, "stored".to_string()),
            (false, PlannedState::Runs | PlannedState::Cached) => (
                PlannedState::LeftOut,
                "nothing that was asked for reads this output".to_string(),
            ),
            _ => (state, reason.to_string()),
        };
        let output = graph.port_name(slot).to_string();
        let same = all.iter_mut().find(|other| other.says_the_same(&one));
        match same {
            Some(same) => same.outputs.push(output),
            None => {
                one.outputs = vec![output];
                all.push(one);
            }
        }
    }
    Ok(all)
}

impl Why {
    /// The same in words, with every fact in which the values of inputs differ: also the hundreds of a report.
    pub fn with_values(&self) -> impl std::fmt::Display + '_ {
        text::WithValues(self)
    }

    /// Whether [`Why::with_values`] says more.
    pub fn has_more_values(&self) -> bool {
        self.to_string() != self.with_values().to_string()
    }

    /// Whether the same is to be said of other outputs of the node. Outputs that were computed by one run may have
    /// taken different times.
    fn says_the_same(&self, other: &Self) -> bool {
        let plain = |why: &Self| {
            let mut why = why.clone();
            why.outputs.clear();
            for run in [&mut why.computed, &mut why.nearest].into_iter().flatten() {
                (run.seconds, run.made) = (0.0, 0);
            }
            why
        };
        plain(self) == plain(other)
    }
}

/// The site of that name, and the slot if a port was named.
fn find(graph: &crate::Graph, name: &str) -> Result<(u32, Option<u32>), RunMistake> {
    let sites = 0..graph.sites() as u32;
    let find = |name: &str| sites.clone().find(|site| graph.site_name(*site) == name);
    if let Some(site) = find(name) {
        return Ok((site, None));
    }
    let (node, port) = name.split_once('.').unwrap_or((name, ""));
    let help = |name: &str, names: Vec<&str>| match nearest(name, names.iter().copied()) {
        Some(near) => Some(format!("did you mean `{near}`?")),
        None => Some(format!("it has {}", names.join(", "))),
    };
    let Some(site) = find(node) else {
        return Err(RunMistake::UnknownName {
            what: "node",
            name: node.to_string(),
            help: help(node, sites.clone().map(|site| graph.site_name(site)).collect()),
        });
    };
    match graph.slots_of(site).find(|slot| graph.port_name(*slot) == port) {
        Some(slot) => Ok((site, Some(slot))),
        None => Err(RunMistake::UnknownName {
            what: "output",
            name: name.to_string(),
            help: help(port, graph.slots_of(site).map(|slot| graph.port_name(slot)).collect()),
        }),
    }
}

struct Explainer<'a> {
    planner: &'a Planner<'a>,
    origins: &'a [Origin],
}

impl Explainer<'_> {
    fn machine(&self) -> &Machine<'_> {
        &self.planner.machine
    }

    fn why(&self, slot: u32) -> Why {
        let machine = self.machine();
        let graph = machine.graph;
        let (demanded, undecided) = self.planner.demand_of(slot);
        let (parts, open) = machine.parts(slot, demanded);
        let undecided: Vec<_> = machine.wires(slot, undecided).collect();
        let skip: Vec<&str> = open
            .iter()
            .chain(&undecided)
            .map(|wire| self.port_name(slot, wire.port))
            .collect();
        let origin = self.own_origin(slot);
        let parts = origin.map_or(parts, |at| self.origins[at].parts.clone());
        let nearest = self.nearest(slot, &parts, &skip, origin);
        let mut ahead: Vec<WhyAhead> = Vec::new();
        let certain = open.iter().map(|wire| (wire, true));
        for (wire, certain) in certain.chain(undecided.iter().map(|wire| (wire, false))) {
            let port = self.port_name(slot, wire.port);
            if ahead.last().is_none_or(|last| last.port != port) {
                ahead.push(WhyAhead {
                    port: port.to_string(),
                    source: graph.slot_name(wire.from),
                    certain,
                    begins: if certain { self.begins(wire.from) } else { Vec::new() },
                });
            }
        }
        Why {
            node: graph.site_name(graph.site_of[slot as usize]).to_string(),
            type_name: parts.type_name.clone(),
            outputs: Vec::new(),
            state: PlannedState::LeftOut,
            reason: String::new(),
            computed: origin.map(|at| told(&self.origins[at])),
            differences: nearest
                .map(|at| self.with_summaries(slot, differences(&self.origins[at].parts, &parts, &skip)))
                .unwrap_or_default(),
            nearest: nearest.map(|at| told(&self.origins[at])),
            ahead,
        }
    }

    fn port_name(&self, slot: u32, port: u16) -> &str {
        let graph = self.machine().graph;
        let node = graph.node_at(graph.site_of[slot as usize]);
        node.map_or("file", |node| node.spec.inputs[usize::from(port)].name)
    }

    /// The latest origin under a slot's very key (or the key that it has on the cpu).
    fn own_origin(&self, slot: u32) -> Option<usize> {
        let keys = self.machine().keys(slot);
        keys.iter()
            .flatten()
            .find_map(|key| self.origins.iter().rposition(|origin| origin.key == *key))
    }

    /// The origin that explains these parts best; of those before `before`, if that is given.
    fn nearest(&self, slot: u32, parts: &Parts, skip: &[&str], before: Option<usize>) -> Option<usize> {
        let graph = self.machine().graph;
        let (site, output) = (graph.site_name(graph.site_of[slot as usize]), graph.port_name(slot));
        let own: Option<Digest> = before.map(|at| self.origins[at].key);
        let best = |fits: &dyn Fn(&Origin) -> bool| {
            self.origins[..before.unwrap_or(self.origins.len())]
                .iter()
                .enumerate()
                .filter(|(_, origin)| fits(origin) && Some(origin.key) != own)
                .min_by_key(|(at, origin)| (count(&origin.parts, parts, skip), usize::MAX - at))
                .map(|(at, _)| at)
        };
        let same_kind = |origin: &Origin| origin.parts.input == parts.input;
        best(&|origin| {
            same_kind(origin) && origin.graph == graph.name() && origin.site == site && origin.output == output
        })
        .or_else(|| {
            best(&|origin| {
                same_kind(origin)
                    && origin.parts.type_name == parts.type_name
                    && (parts.input || origin.output == output)
            })
        })
    }

    /// The nodes at which a change begins that makes this slot run: those that read nothing that is not known.
    fn begins(&self, slot: u32) -> Vec<(String, String)> {
        let machine = self.machine();
        let graph = machine.graph;
        let mut begins: Vec<(String, String)> = Vec::new();
        let mut seen = BTreeSet::new();
        let mut stack = vec![slot];
        while let Some(slot) = stack.pop() {
            if !seen.insert(slot) || begins.len() >= AHEAD {
                continue;
            }
            let (demanded, undecided) = self.planner.demand_of(slot);
            let (parts, open) = machine.parts(slot, demanded);
            if !open.is_empty() {
                stack.extend(open.iter().rev().map(|wire| wire.from));
                continue;
            }
            let name = graph.site_name(graph.site_of[slot as usize]);
            if begins.iter().any(|(known, _)| known == name) {
                continue;
            }
            let reason = match self.planner.own_reason(slot) {
                Some(reason) => reason.to_string(),
                None => self.what_changed(slot, &parts, undecided),
            };
            begins.push((name.to_string(), reason));
        }
        begins
    }

    /// In what a slot whose inputs are known differs from its nearest run, in one line.
    fn what_changed(&self, slot: u32, parts: &Parts, undecided: u64) -> String {
        let machine = self.machine();
        if self.own_origin(slot).is_some() {
            return "what it gave is not in the store any more".to_string();
        }
        let skip: Vec<&str> = machine
            .wires(slot, undecided)
            .map(|wire| self.port_name(slot, wire.port))
            .collect();
        let Some(at) = self.nearest(slot, parts, &skip, None) else {
            return format!("`{}` was never computed before", machine.graph.slot_name(slot));
        };
        let all: Vec<_> = differences(&self.origins[at].parts, parts, &skip)
            .iter()
            .map(ToString::to_string)
            .collect();
        match all.as_slice() {
            [] => "it looks at values before it is known what it needs".to_string(),
            all => all.join("; "),
        }
    }

    /// Adds what stored values say about inputs that differ.
    fn with_summaries(&self, slot: u32, mut differences: Vec<Difference>) -> Vec<Difference> {
        let machine = self.machine();
        let Some(store) = &machine.run.store else {
            return differences;
        };
        let graph = machine.graph;
        let wires: Vec<_> = machine.wires(slot, u64::MAX).collect();
        for difference in differences
            .iter_mut()
            .filter(|difference| difference.part == Part::Input)
        {
            let Some(wire) = wires
                .iter()
                .find(|wire| self.port_name(slot, wire.port) == difference.name)
            else {
                continue;
            };
            let value_type = graph.slot_type(wire.from);
            let summary = |hex: &Option<String>| -> Option<Summary> {
                let digest = Digest::from_hex(hex.as_deref()?)?;
                Some(store.load(&digest, &value_type)?.summary())
            };
            if let (Some(old), Some(new)) = (summary(&difference.old), summary(&difference.new)) {
                let changed = leaves(&Json::Object(old), &Json::Object(new));
                difference.summary = changed
                    .into_iter()
                    .map(|(name, old, new)| (name, short(old), short(new)))
                    .collect();
            }
        }
        differences
    }
}

fn short(value: Option<Json>) -> String {
    value.map_or("none".to_string(), |value| value.to_string())
}

fn told(origin: &Origin) -> EarlierRun {
    EarlierRun {
        run: format!("{:016x}", origin.run),
        made: origin.made,
        seconds: origin.seconds,
        graph: origin.graph.clone(),
        node: origin.site.clone(),
    }
}

/// In how many parts two keys differ; a cheap measure of nearness.
fn count(old: &Parts, new: &Parts, skip: &[&str]) -> usize {
    differences(old, new, skip).len()
}

/// In what two keys differ, ports in `skip` apart.
fn differences(old: &Parts, new: &Parts, skip: &[&str]) -> Vec<Difference> {
    let mut all = Vec::new();
    let mut add = |part: Part, name: &str, old: Option<String>, new: Option<String>, source: Option<String>| {
        if old != new {
            all.push(Difference {
                part,
                name: name.to_string(),
                old,
                new,
                source,
                summary: Vec::new(),
            });
        }
    };
    if old.params != new.params {
        let json = |text: &str| serde_json::from_str(text).unwrap_or(Json::Object(Default::default()));
        for (name, old, new) in leaves(&json(&old.params), &json(&new.params)) {
            let text = |value: Option<Json>| value.map(|value| value.to_string());
            add(Part::Parameter, &name, text(old), text(new), None);
        }
    }
    let names: BTreeSet<&str> = old
        .ports
        .iter()
        .chain(&new.ports)
        .map(|port| port.port.as_str())
        .collect();
    for name in names.into_iter().filter(|name| !skip.contains(name)) {
        let of = |parts: &Parts| parts.ports.iter().find(|port| port.port == name).cloned();
        let (old, new) = (of(old), of(new));
        let text = |port: &crate::store::PortPart| -> String {
            let digests: Vec<_> = port.digests.iter().map(Digest::hex).collect();
            digests.join(" ")
        };
        let source = match (&old, &new) {
            (Some(old), Some(new)) if old.port == "file" && old.source != new.source => {
                Some(format!("{}, before {}", new.source, old.source))
            }
            (old, new) => new.as_ref().or(old.as_ref()).map(|port| port.source.clone()),
        };
        add(
            Part::Input,
            name,
            old.as_ref().map(text),
            new.as_ref().map(text),
            source,
        );
    }
    let plain = |text: &str| Some(text.to_string());
    add(Part::Type, "", plain(&old.type_name), plain(&new.type_name), None);
    if old.type_name == new.type_name {
        let version = |parts: &Parts| Some(parts.version.to_string());
        add(Part::Version, &new.type_name, version(old), version(new), None);
    }
    let crates: BTreeSet<&str> = old
        .numerics
        .iter()
        .chain(&new.numerics)
        .map(|(name, _)| name.as_str())
        .collect();
    for name in crates {
        let of = |parts: &Parts| {
            let found = parts.numerics.iter().find(|(known, _)| known == name);
            found.map(|(_, version)| version.to_string())
        };
        add(Part::Numerics, name, of(old), of(new), None);
    }
    add(Part::Realm, "", plain(&old.realm), plain(&new.realm), None);
    let elision = |parts: &Parts| plain(if parts.no_elision { "off" } else { "on" });
    add(Part::Elision, "", elision(old), elision(new), None);
    all
}

/// The leaves in which two trees differ, by their path; a choice that is another is one leaf.
fn leaves(old: &Json, new: &Json) -> Vec<(String, Option<Json>, Option<Json>)> {
    let mut found = Vec::new();
    let mut stack = vec![(String::new(), Some(old), Some(new))];
    while let Some((path, old, new)) = stack.pop() {
        if old == new {
            continue;
        }
        match (old, new) {
            (Some(Json::Object(a)), Some(Json::Object(b)))
                if path.is_empty() || a.keys().any(|key| b.contains_key(key)) =>
            {
                let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
                for name in names.into_iter().rev() {
                    let below = if path.is_empty() {
                        name.clone()
                    } else {
                        format!("{path}.{name}")
                    };
                    stack.push((below, a.get(name), b.get(name)));
                }
            }
            _ => found.push((path, old.cloned(), new.cloned())),
        }
    }
    found
}
