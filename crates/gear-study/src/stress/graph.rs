//! Graphs on the values of the catalogue: every input is extreme once, and every node is looked at.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use gear_graph::{AnyValue, Event, FailureKind, Graph, Input, NodeStatus, Run};

use super::{Catalogue, Options, Outcome, Row};
use crate::planes::{Extent, extent, planes};

/// What was seen of the values of a node.
#[derive(Default)]
struct Seen {
    extent: Option<Extent>,
    flaw: Option<String>,
}

/// Feeds a graph the values of the types of its inputs, one input at a time; the other required inputs get ordinary
/// values that go with it. `set_up` adds to a run what it needs, such as a device.
///
/// A node that refuses its inputs with an error is no surprise here: what it was given is what nodes before it made.
pub fn stress_graph<'g>(
    catalogue: &Catalogue,
    graph: &'g Graph,
    options: &Options,
    set_up: &dyn Fn(Run<'g>) -> Run<'g>,
    tell: &mut dyn FnMut(&Row),
) -> Vec<Row> {
    let mut rows = Vec::new();
    for extreme in graph.inputs() {
        let values = catalogue.values.iter();
        let fitting = values.filter(|named| named.value.value_type() == extreme.value_type);
        for named in fitting.filter(|named| named.value.size_bytes() <= options.largest) {
            let mut run = set_up(Run::new(graph)).input(extreme.name.clone(), Input::Value(named.value.clone()));
            for other in graph.inputs() {
                if other.name != extreme.name && !other.optional {
                    let ordinary = catalogue.ordinary.get(other.value_type.name);
                    if let Some(value) = ordinary {
                        let value = value.matched(&named.value).unwrap_or_else(|| value.clone());
                        run = run.input(other.name.clone(), Input::Value(value));
                    }
                }
            }
            let case = format!("{} = {}", extreme.name, named.name);
            for row in one(run, &case) {
                tell(&row);
                rows.push(row);
            }
        }
    }
    rows
}

fn one(run: Run<'_>, case: &str) -> Vec<Row> {
    let seen: Arc<Mutex<BTreeMap<String, Seen>>> = Arc::default();
    let heard = Arc::clone(&seen);
    let observer = move |event: &Event<'_>| {
        if let Event::Value { node, value, .. } = event {
            look(&heard, node, value);
        }
    };
    let outcome = match run.observer(Arc::new(observer)).go() {
        Ok(outcome) => outcome,
        Err(mistakes) => {
            let message = mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            return vec![Row {
                surprise: Some(message.clone()),
                message,
                ..row("graph", case, Outcome::Breaks)
            }];
        }
    };
    let report = outcome.report;
    let seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
    let nodes = report.nodes.iter().filter(|node| !node.input);
    nodes
        .map(|node| {
            let failure = report.failures.iter().find(|failure| failure.node == node.id);
            let values = seen.get(&node.id);
            let flaw = values.and_then(|seen| seen.flaw.clone());
            let (outcome, message) = match (failure, flaw, node.status) {
                (Some(failure), ..) if failure.kind == FailureKind::Panic => {
                    (Outcome::Breaks, format!("panics: {}", failure.chain.join(": ")))
                }
                (Some(failure), ..) => (Outcome::Refuses, failure.chain.join(": ")),
                (None, Some(flaw), _) => (Outcome::Breaks, flaw),
                (None, None, NodeStatus::Ran) => (Outcome::Answers, String::new()),
                (None, None, _) => (Outcome::Idle, node.reason.clone().unwrap_or_default()),
            };
            Row {
                surprise: (outcome == Outcome::Breaks).then(|| message.clone()),
                message,
                extent: values.and_then(|seen| seen.extent),
                seconds: if outcome == Outcome::Answers { node.seconds } else { 0.0 },
                ..row(&node.id, case, outcome)
            }
        })
        .collect()
}

/// Remembers the extent of a node's values, and the first flaw.
fn look(seen: &Mutex<BTreeMap<String, Seen>>, node: &str, value: &AnyValue) {
    let found = extent(&planes(value));
    let flaw = value.flaw();
    let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
    let entry = seen.entry(node.to_owned()).or_default();
    entry.flaw = entry.flaw.take().or(flaw);
    entry.extent = Some(match entry.extent {
        None => found,
        Some(before) => Extent {
            count: before.count + found.count,
            not_finite: before.not_finite + found.not_finite,
            low: before.low.min(found.low),
            high: before.high.max(found.high),
        },
    });
}

fn row(node: &str, case: &str, outcome: Outcome) -> Row {
    Row {
        node: node.to_owned(),
        case: case.to_owned(),
        outcome,
        expected: None,
        message: String::new(),
        extent: None,
        error: None,
        seconds: 0.0,
        surprise: None,
    }
}
