//! The comparison of two records.

use std::collections::BTreeSet;

use serde::Serialize;

use super::outputs::{OutputDifference, Values};
use super::record::{self, NodeRecord, Record};

/// What differs between two runs.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Comparison {
    /// Facts of the runs that differ: what, in the one, in the other.
    pub facts: Vec<Changed>,
    /// Every node and input of either run, producers first.
    pub nodes: Vec<NodeDifference>,
    /// Every output of either run.
    pub outputs: Vec<OutputDifference>,
}

/// Something that is one thing in the one run and another in the other; empty where it is not there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Changed {
    /// What.
    pub what: String,
    /// In the first run.
    pub a: String,
    /// In the second run.
    pub b: String,
}

/// A node in both runs.
#[derive(Clone, Debug, Serialize)]
pub struct NodeDifference {
    /// Its name.
    pub id: String,
    /// What became of its results.
    pub fate: Fate,
    /// What was changed at the node itself: parameters, type, version, realm, source.
    pub changed: Vec<Changed>,
    /// Seconds of its computation in both runs, where it took part.
    pub seconds: (Option<f64>, Option<f64>),
    /// What became of it in both runs.
    pub status: (String, String),
}

/// What became of a node's results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// Same key, same results.
    Same,
    /// Other keys, and yet the same results: whatever is behind it could be taken from the store.
    SameResult,
    /// Same key, other results: it does not promise the same bits, or something is broken.
    Unfaithful,
    /// Other results, because the node itself was changed.
    ChangedHere,
    /// Other results, because of what it read.
    ChangedBefore,
    /// It took part in one run only.
    OneRun,
    /// It took part in neither.
    Neither,
}

impl Fate {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Same => "the same",
            Self::SameResult => "computed from other things, and the same",
            Self::Unfaithful => "other results from the same things",
            Self::ChangedHere => "other results, changed here",
            Self::ChangedBefore => "other results, from other inputs",
            Self::OneRun => "in one run only",
            Self::Neither => "in neither run",
        }
    }
}

impl Comparison {
    /// Whether every output is the same in both runs.
    pub fn same_outputs(&self) -> bool {
        self.outputs.iter().all(|output| output.same)
    }
}

/// Compares two runs; values are looked up in `values` where their digests differ.
pub fn compare(a: &Record, b: &Record, values: &Values<'_>) -> Comparison {
    let mut comparison = Comparison::default();
    let mut fact = |what: &str, a: String, b: String| {
        if a != b {
            comparison.facts.push(Changed {
                what: what.to_owned(),
                a,
                b,
            });
        }
    };
    fact("graph", a.graph.clone(), b.graph.clone());
    fact("ended", a.status.clone(), b.status.clone());
    fact("version", a.version.clone(), b.version.clone());
    fact("threads", a.jobs.to_string(), b.jobs.to_string());
    let store = |record: &Record| {
        record
            .store
            .as_ref()
            .map(|s| s.display().to_string())
            .unwrap_or_default()
    };
    fact("store", store(a), store(b));
    for id in ids(a, b) {
        let find = |record: &'_ Record| record.nodes.iter().find(|node| node.id == id).cloned();
        comparison.nodes.push(node(&id, find(a), find(b)));
    }
    let mut seen = BTreeSet::new();
    for output in a.outputs.iter().chain(&b.outputs) {
        if seen.insert(&output.name) {
            let find = |record: &'_ Record| record.outputs.iter().find(|o| o.name == output.name).cloned();
            comparison
                .outputs
                .push(values.difference(&output.name, find(a), find(b)));
        }
    }
    comparison
}

/// The names of both, in the order of the first; what only the second has stands behind what it stood behind there.
fn ids(a: &Record, b: &Record) -> Vec<String> {
    let mut ids: Vec<String> = a.nodes.iter().map(|node| node.id.clone()).collect();
    let mut behind = 0;
    for node in &b.nodes {
        match ids.iter().position(|id| *id == node.id) {
            Some(at) => behind = at + 1,
            None => {
                ids.insert(behind.min(ids.len()), node.id.clone());
                behind += 1;
            }
        }
    }
    ids
}

fn node(id: &str, a: Option<NodeRecord>, b: Option<NodeRecord>) -> NodeDifference {
    let took_part = |node: &NodeRecord| !node.ports.is_empty();
    let seconds = |node: &Option<NodeRecord>| node.as_ref().filter(|n| took_part(n)).map(|n| n.seconds);
    let status = |node: &Option<NodeRecord>| node.as_ref().map(|n| n.status.clone()).unwrap_or_default();
    let changed = changes(&a, &b);
    let fate = match (&a, &b) {
        (Some(a), Some(b)) if took_part(a) && took_part(b) => {
            // A run may have asked for fewer outputs.
            let both: Vec<_> = a
                .ports
                .iter()
                .filter_map(|(port, of_a)| Some((of_a, b.ports.get(port)?)))
                .collect();
            let digests = both.iter().all(|(a, b)| a.1 == b.1);
            let keys = both.iter().all(|(a, b)| a.0 == b.0);
            match (keys, digests) {
                _ if both.is_empty() => Fate::OneRun,
                (true, true) => Fate::Same,
                (false, true) => Fate::SameResult,
                (true, false) if both.iter().any(|(a, _)| !a.0.is_empty()) => Fate::Unfaithful,
                _ if !changed.is_empty() => Fate::ChangedHere,
                _ => Fate::ChangedBefore,
            }
        }
        (a, b) if a.as_ref().is_some_and(took_part) != b.as_ref().is_some_and(took_part) => Fate::OneRun,
        _ => Fate::Neither,
    };
    NodeDifference {
        id: id.to_owned(),
        fate,
        seconds: (seconds(&a), seconds(&b)),
        status: (status(&a), status(&b)),
        changed,
    }
}

/// What differs at the node itself. A node that is in one run only is no change of its own.
fn changes(a: &Option<NodeRecord>, b: &Option<NodeRecord>) -> Vec<Changed> {
    let (Some(a), Some(b)) = (a, b) else {
        return Vec::new();
    };
    let mut changes = Vec::new();
    let mut change = |what: &str, a: &str, b: &str| {
        if a != b {
            changes.push(Changed {
                what: what.to_owned(),
                a: a.to_owned(),
                b: b.to_owned(),
            });
        }
    };
    change("made by", &a.made_by, &b.made_by);
    change("source", &a.source, &b.source);
    for (name, a, b) in record::changes(&a.params, &b.params) {
        change(&name, &a, &b);
    }
    changes
}
