//! Nodes on the values of the catalogue, one port extreme at a time; and its cases.

use gear_graph::testing::{self, Subject, Trial, Tried};
use gear_graph::{AnyValue, GraphSource, NodeType, Registry, Slot};
use serde_json::Value as Json;

use super::reference::{self, Given};
use super::{Case, Catalogue, Holds, NodeEntry, Options, Outcome, Row};
use crate::planes::{extent, planes};

/// Sweeps a registered node type, with its defaults but for what the catalogue sets and `with` sets over that. The
/// mistakes in the parameters if there are any.
pub fn stress_node(
    catalogue: &Catalogue,
    node_type: &NodeType,
    with: &serde_json::Map<String, Json>,
    options: &Options,
    tell: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, String> {
    let entry = catalogue.nodes.get(node_type.spec.name);
    let mut params = entry.map(|entry| entry.with.clone()).unwrap_or_default();
    params.extend(with.clone());
    let subject = Subject::of(node_type, &Json::Object(params)).map_err(|problems| {
        let messages: Vec<_> = problems.into_iter().map(|problem| problem.message).collect();
        messages.join("; ")
    })?;
    Ok(stress_subject(catalogue, &subject, options, tell))
}

/// Sweeps a node with its parameters.
pub fn stress_subject(
    catalogue: &Catalogue,
    subject: &Subject,
    options: &Options,
    tell: &mut dyn FnMut(&Row),
) -> Vec<Row> {
    let spec = subject.spec();
    let entry = catalogue.nodes.get(spec.name);
    let ordinary: Vec<Slot> = spec
        .inputs
        .iter()
        .map(|port| {
            let value = catalogue.ordinary.get(port.value_type.name);
            value.filter(|_| !port.optional).cloned().into_iter().collect()
        })
        .collect();
    let mut rows = Vec::new();
    let mut row = |row: Row| {
        tell(&row);
        rows.push(row);
    };
    // Whether anything has hung: what still runs would take the time of what follows.
    let mut hung = false;
    for (at, port) in spec.inputs.iter().enumerate() {
        let values = catalogue.values.iter();
        let fitting = values.filter(|named| named.value.value_type() == port.value_type);
        for named in fitting.filter(|named| named.value.size_bytes() <= options.largest) {
            if hung {
                return rows;
            }
            let mut inputs = ordinary.clone();
            inputs[at] = vec![named.value.clone()];
            testing::fit(&mut inputs, at);
            let trial = subject.attempt_on(inputs.clone(), &options.resources, options.patience);
            hung |= matches!(trial.tried, Tried::Hangs);
            let expected = entry.map(|entry| match entry.refuses(port.name, &named.name) {
                true => Outcome::Refuses,
                false => Outcome::Answers,
            });
            let tolerance = |output: &str| entry.and_then(|entry| entry.tolerance(output, &named.name));
            let mut found = judged(subject, &inputs, &trial, expected, &tolerance);
            found.case = format!("{} = {}", port.name, named.name);
            row(found);
        }
    }
    rows
}

/// Runs a case.
pub fn stress_case(catalogue: &Catalogue, case: &Case, registry: &Registry, options: &Options) -> Row {
    let mut row = Row {
        node: case.node.clone(),
        case: case.name.clone(),
        outcome: Outcome::Breaks,
        expected: Some(match case.expect.refused {
            Some(_) => Outcome::Refuses,
            None => Outcome::Answers,
        }),
        message: String::new(),
        extent: None,
        error: None,
        seconds: 0.0,
        surprise: None,
    };
    let lost = |mut row: Row, why: String| {
        row.surprise = Some(why);
        row
    };
    let Some(node_type) = registry.find_node(&case.node) else {
        return lost(row, format!("there is no node type `{}`", case.node));
    };
    let params = Json::Object(case.with.clone());
    let refusal = match case.nan.is_empty() {
        true => Subject::refusal(node_type, &params),
        false => refused_by_check(case, node_type, registry),
    };
    if let Some(message) = refusal {
        row.outcome = Outcome::Refuses;
        row.message = message;
        return refused(case, row);
    }
    let subject = match Subject::of(node_type, &params) {
        Ok(subject) => subject,
        Err(_) => return lost(row, "its parameters are refused only the second time".to_owned()),
    };
    let ports = &subject.spec().inputs;
    if let Some(name) = case
        .inputs
        .keys()
        .find(|name| !ports.iter().any(|port| port.name == name.as_str()))
    {
        return lost(row, format!("`{}` has no input port `{name}`", case.node));
    }
    let slot = |name: &str| case.inputs.get(name).and_then(|value| catalogue.find(value));
    let mut inputs: Vec<Slot> = ports
        .iter()
        .map(|port| slot(port.name).map(|named| named.value.clone()).into_iter().collect())
        .collect();
    testing::fit(&mut inputs, 0);
    let trial = subject.attempt_on(inputs.clone(), &options.resources, options.patience);
    let entry = catalogue.nodes.get(&case.node);
    let value_names: Vec<&String> = case.inputs.values().collect();
    let tolerance = |output: &str| {
        let of = |name: &&String| entry.and_then(|entry: &NodeEntry| entry.tolerance(output, name));
        value_names.iter().filter_map(of).reduce(f64::max)
    };
    let mut found = judged(&subject, &inputs, &trial, row.expected, &tolerance);
    found.case = case.name.clone();
    if found.outcome == Outcome::Refuses {
        return refused(case, found);
    }
    if let (Tried::Answered(outputs), None) = (&trial.tried, &found.surprise) {
        found.surprise = case.expect.outputs.iter().find_map(|(port, holds)| {
            let Some((_, value)) = outputs.iter().find(|(name, _)| name == port) else {
                return Some(format!("`{}` has no output `{port}`", case.node));
            };
            let same = holds
                .same_as
                .as_ref()
                .map(|input| slot(input).map(|named| &named.value));
            missed(holds, value, same).map(|why| format!("`{port}` {why}"))
        });
    }
    found
}

/// What the check of a graph says of parameters that are NaN, which JSON cannot hold.
fn refused_by_check(case: &Case, node_type: &NodeType, registry: &Registry) -> Option<String> {
    let spec = &node_type.spec;
    let inputs: Vec<_> = spec
        .inputs
        .iter()
        .map(|port| format!("{}: {}", port.name, port.value_type.name))
        .collect();
    let wires: Vec<_> = spec.inputs.iter().map(|port| format!("{0}: {0}", port.name)).collect();
    let params: Vec<_> = case.nan.iter().map(|name| format!("{name}: .nan")).collect();
    let text = format!(
        "gear: 1\ninputs: {{{}}}\nnodes: {{tried: {{node: {}, in: {{{}}}, with: {{{}}}}}}}\noutputs: {{out: tried.{}}}\n",
        inputs.join(", "),
        spec.name,
        wires.join(", "),
        params.join(", "),
        spec.outputs.first()?.name,
    );
    let mistakes = GraphSource::new(&case.name, text).check(registry).err()?;
    let messages: Vec<_> = mistakes
        .problems()
        .iter()
        .map(|problem| problem.message.as_str())
        .collect();
    Some(messages.join("; "))
}

/// A refusal is expected only with the words that the case has.
fn refused(case: &Case, mut row: Row) -> Row {
    row.surprise = match &case.expect.refused {
        None => Some(format!("expected an answer, found the error: {}", row.message)),
        Some(words) if row.message.contains(words.as_str()) => None,
        Some(words) => Some(format!("expected an error with `{words}`, found: {}", row.message)),
    };
    row
}

/// Why an output is not what it should be.
fn missed(holds: &Holds, value: &AnyValue, same: Option<Option<&AnyValue>>) -> Option<String> {
    let found = planes(value);
    if let Some([low, high]) = holds.range {
        let extent = extent(&found);
        if extent.low < low - holds.within || extent.high > high + holds.within {
            return Some(format!(
                "should lie in {low}..{high} within {:e}, found {:e}..{:e}",
                holds.within, extent.low, extent.high
            ));
        }
    }
    match same {
        None => None,
        Some(None) => Some("should be an input that is not given".to_owned()),
        Some(Some(input)) => {
            let off = reference::error(&planes(input), &found);
            (off > holds.within).then(|| format!("should be its input within {:e}, is {off:e} away", holds.within))
        }
    }
}

/// A trial as a row.
fn judged(
    subject: &Subject,
    inputs: &[Slot],
    trial: &Trial,
    expected: Option<Outcome>,
    tolerance: &dyn Fn(&str) -> Option<f64>,
) -> Row {
    let (outcome, message) = match &trial.tried {
        Tried::Answered(_) => (Outcome::Answers, String::new()),
        Tried::Refused(message) => (Outcome::Refuses, message.clone()),
        Tried::Broke(why) => (Outcome::Breaks, why.clone()),
        Tried::Hangs => (Outcome::Hangs, format!("no answer in {:.0} s", trial.seconds)),
    };
    let mut row = Row {
        node: subject.title().to_owned(),
        case: String::new(),
        outcome,
        expected,
        message,
        extent: None,
        error: None,
        seconds: trial.seconds,
        surprise: None,
    };
    row.surprise = match (outcome, expected) {
        (Outcome::Breaks | Outcome::Hangs, _) => Some(row.message.clone()),
        (Outcome::Refuses, Some(Outcome::Answers)) => {
            Some(format!("expected an answer, found the error: {}", row.message))
        }
        (Outcome::Answers, Some(Outcome::Refuses)) => Some("expected an error, found an answer".to_owned()),
        _ => None,
    };
    if let Tried::Answered(outputs) = &trial.tried {
        let all: Vec<_> = outputs.iter().flat_map(|(_, value)| planes(value)).collect();
        row.extent = Some(extent(&all));
        let ports = subject.spec().inputs.iter().map(|port| port.name);
        let inputs: Vec<_> = ports.zip(inputs.iter().cloned()).collect();
        let params = subject.params();
        let given = Given {
            node: subject.spec().name,
            params: &params,
            inputs: &inputs,
            outputs,
        };
        for (port, value) in outputs {
            let Some(slow) = reference::reference(&given, port) else {
                continue;
            };
            let off = reference::error(&slow, &planes(value));
            row.error = Some(row.error.map_or(off, |before: f64| before.max(off)));
            if let Some(most) = tolerance(port)
                && off > most
                && row.surprise.is_none()
            {
                row.surprise = Some(format!(
                    "`{port}` is {off:.1e} from its f64 reference, expected at most {most:.1e}"
                ));
            }
        }
    }
    row
}
