//! The test of a plugin, as `gear plugin check` runs it: the folder, the protocol, and the promises of every node.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use gear_graph::testing::Subject;
use gear_graph::{NodeType, Registry};
use serde_json::{Value, json};

use crate::worker::Worker;
use crate::{Failure, Plugin};

/// Extreme cases whose answers a second process must give again.
const ASKED_AGAIN: usize = 12;

/// Something that was looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What.
    pub what: String,
    /// What is wrong with it, if anything is.
    pub wrong: Option<String>,
}

/// Tests the plugin in a folder; `params` are those that its nodes are tested with, by node. `tell` hears every finding as
/// it comes. Whether all is well.
///
/// Extreme inputs are those that the value types of `registry` declare; the registry must not have the plugin's nodes.
pub fn conformance(folder: &Path, registry: &Registry, params: &Value, tell: &mut dyn FnMut(&Finding)) -> bool {
    let mut well = true;
    let mut say = |what: &str, result: Result<(), String>| {
        well &= result.is_ok();
        tell(&Finding {
            what: what.to_owned(),
            wrong: result.err(),
        });
    };
    let plugin = match Plugin::ask(folder) {
        Ok(plugin) => plugin,
        Err(error) => {
            say("folder, sources and handshake", Err(error.to_string()));
            return false;
        }
    };
    say("folder, sources and handshake", Ok(()));
    // A program is started in the plugin's folder: a relative path to it would be looked for from there.
    let folder = plugin.folder();
    if let Some(file) = plugin.nodes_file() {
        say(
            "the file of descriptions is what the worker says",
            up_to_date(folder, &plugin, &file),
        );
    }
    let mut registry = registry.clone();
    if let Err(error) = plugin.register(&mut registry) {
        say("descriptions of the nodes", Err(error.to_string()));
        return false;
    }
    say("descriptions of the nodes", Ok(()));
    say("the same description from a second worker", same_again(&plugin));
    say(
        "requests that make no sense get errors, and the worker goes on",
        nonsense(folder, &plugin),
    );
    for node in plugin.nodes() {
        let Some(node_type) = registry.find_node(&node.name) else {
            continue;
        };
        if let Some(undocumented) = undocumented(node_type) {
            say(&format!("{}: docs", node.name), Err(undocumented));
        }
        let given = params.get(&node.name).cloned().unwrap_or(json!({}));
        say(&format!("{}: extreme inputs", node.name), extremes(node_type, &given));
        say(
            &format!("{}: an answer to some of them", node.name),
            answers(node_type, &given),
        );
        if node.deterministic {
            say(
                &format!("{}: the same bits from another process", node.name),
                elsewhere(&plugin, node_type, &given),
            );
        }
    }
    well
}

fn up_to_date(folder: &Path, asked: &Plugin, file: &Path) -> Result<(), String> {
    let read = Plugin::open(folder, None).map_err(|error| error.to_string())?;
    if read.nodes() == asked.nodes() {
        Ok(())
    } else {
        Err(format!(
            "{} says something else; `gear plugin describe` writes it anew",
            file.display()
        ))
    }
}

fn same_again(plugin: &Plugin) -> Result<(), String> {
    let (first, second) = (plugin.hello(None), plugin.hello(None));
    match (first, second) {
        (Ok(first), Ok(second)) if first == second => Ok(()),
        (Ok(_), Ok(_)) => Err("two handshakes differ: results would never be found again".to_owned()),
        (Err(error), _) | (_, Err(error)) => Err(error.to_string()),
    }
}

/// JSON-RPC 2.0, section 5.1: −32601 for a method that there is not.
fn nonsense(folder: &Path, plugin: &Plugin) -> Result<(), String> {
    let patience = plugin.manifest().timeouts.start();
    let mut worker = Worker::start(folder, plugin.manifest()).map_err(|error| error.to_string())?;
    worker.greet().map_err(|error| error.to_string())?;
    let mut ask = |method: &str, params: Value| worker.ask(method, params, patience, "during a strange request", None);
    match ask("no-such-method", json!({})) {
        Err(Failure::Remote { code: -32601, .. }) => {}
        other => {
            return Err(format!(
                "expected the error -32601 for a method that there is not, found {other:?}"
            ));
        }
    }
    for params in [
        json!({}),
        json!({"node": "NoSuchNode", "params": {}, "inputs": {}, "outputs": {}, "folder": "x", "seed": 0}),
    ] {
        match ask("run", params) {
            Err(Failure::Remote { message, .. }) if !message.trim().is_empty() => {}
            other => {
                return Err(format!(
                    "expected an error with a message for a run of nothing, found {other:?}"
                ));
            }
        }
    }
    Ok(())
}

fn undocumented(node: &NodeType) -> Option<String> {
    let spec = &node.spec;
    let ports = spec
        .inputs
        .iter()
        .chain(&spec.outputs)
        .map(|port| (port.name, port.doc));
    let all = ports.chain(spec.params.iter().map(|param| (param.name, param.doc)));
    let all = all.chain([(spec.name, spec.doc)]);
    let missing: Vec<_> = all
        .filter(|(_, doc)| doc.trim().is_empty())
        .map(|(name, _)| name)
        .collect();
    (!missing.is_empty()).then(|| format!("nothing is said of {}", missing.join(", ")))
}

fn extremes(node: &NodeType, params: &Value) -> Result<(), String> {
    quietly(|| gear_graph::testing::assert_type(node, params))
}

fn subject(node: &NodeType, params: &Value) -> Result<Subject, String> {
    Subject::of(node, params).map_err(|problems| {
        let causes: Vec<_> = problems.into_iter().map(|problem| problem.message).collect();
        causes.join("; ")
    })
}

/// An error is a good answer to an extreme input; to every one of them it is none.
fn answers(node: &NodeType, params: &Value) -> Result<(), String> {
    let given = subject(node, params)?.answers(ASKED_AGAIN);
    match given
        .iter()
        .find_map(|(case, answer)| Some((case, answer.as_ref().err()?)))
    {
        Some((case, error)) if given.iter().all(|(_, answer)| answer.is_err()) => {
            Err(format!("none of {} inputs is answered; {case}: {error}", given.len()))
        }
        _ => Ok(()),
    }
}

fn elsewhere(plugin: &Plugin, node: &NodeType, params: &Value) -> Result<(), String> {
    let subject = subject(node, params)?;
    let first = subject.answers(ASKED_AGAIN);
    plugin.rest();
    let second = subject.answers(ASKED_AGAIN);
    match first.iter().zip(&second).find(|(a, b)| a != b) {
        None => Ok(()),
        Some((a, b)) => Err(format!(
            "gives {:?} in one process and {:?} in another for {}",
            a.1, b.1, a.0
        )),
    }
}

/// Runs assertions; what they complain of.
fn quietly(assertions: impl FnOnce()) -> Result<(), String> {
    catch_unwind(AssertUnwindSafe(assertions)).map_err(|cause| {
        let text = cause.downcast_ref::<String>().cloned();
        text.or_else(|| cause.downcast_ref::<&str>().map(ToString::to_string))
            .unwrap_or_else(|| "it panics".to_owned())
    })
}
