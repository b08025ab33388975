//! What a node author tests a node with: one node on plain values, without a graph.
//!
//! ```text
//! run, run_wanting     one run, all outputs or some
//! read, check          parameters as a graph would read and refuse them
//! summaries, digests   what came out, to pin as a snapshot or to compare
//! assert_pure          the promises of every node: the same bits twice, on 1, 2 and 8 threads, beside other runs of the
//!                      same node, and whichever outputs are wanted; an interrupted run gives no result or the same one
//! assert_extremes      an answer or an error, never a panic, a hang or a flawed value, on all extreme cases that the
//!                      value types of its ports declare
//! assert_type          the last for a registered node type with each of its methods, known by name only
//! assert_codec         the promises of every value type
//! Subject::attempt_on  what a node does with given inputs, judged by whoever asked: see the catalogue of extreme cases
//!                      in `gear-study`
//! ```
//!
//! The assertions work on a [`Subject`], a node whose Rust type is forgotten, so that they serve one node in its own
//! crate and a whole registry alike.

mod cases;
mod codec;
mod extremes;
mod in_memory;
mod purity;
mod subject;
mod trial;

pub use codec::assert_codec;
pub use in_memory::InMemory;
pub use subject::Subject;
pub use trial::{Trial, Tried, fit};

use crate::{Context, Fields, Inputs, Node, NodeError, NodeType, Outputs, Params, Problem, Span, Tree, Want};

/// Runs a node with all outputs wanted, after checking its parameters as a graph would.
pub fn run<N: Node>(node: &N, inputs: N::Inputs) -> Result<N::Outputs, NodeError> {
    check(node)?;
    node.run(inputs, &Want::all::<N::Outputs>(), &Context::detached())
}

/// Runs a node with only some outputs wanted.
pub fn run_wanting<N: Node>(node: &N, inputs: N::Inputs, outputs: &[&str]) -> Result<N::Outputs, NodeError> {
    check(node)?;
    node.run(inputs, &Want::only::<N::Outputs>(outputs), &Context::detached())
}

/// Checks the parameters as a graph would: ranges, NaN, [`Node::check`].
pub fn check<N: Node>(node: &N) -> Result<(), NodeError> {
    let written = serde_json::Value::Object(node.write());
    match read::<N>(&written) {
        Ok(_) => node.check(),
        Err(problems) => Err(NodeError::new(
            problems
                .iter()
                .map(|p| p.message.as_str())
                .collect::<Vec<_>>()
                .join("; "),
        )),
    }
}

/// Reads parameters from JSON, as a graph would read them from YAML; the mistakes if there are any.
pub fn read<P: Params>(params: &serde_json::Value) -> Result<P, Vec<Problem>> {
    read_with(params, P::read)
}

fn read_with<T>(
    params: &serde_json::Value,
    read: impl FnOnce(&mut Fields<'_, '_>) -> Option<T>,
) -> Result<T, Vec<Problem>> {
    let mut problems = Vec::new();
    let tree = Tree::from_json(params);
    let read = Fields::new(Some(&tree), Span::default(), "the node under test", &mut problems)
        .and_then(|mut fields| read(&mut fields));
    match read {
        Some(params) if problems.is_empty() => Ok(params),
        _ => Err(problems),
    }
}

/// The digests of all outputs, by port: two runs gave the same bits if these are equal.
pub fn digests<O: Outputs>(outputs: O) -> Vec<(&'static str, Option<crate::Digest>)> {
    O::specs()
        .iter()
        .map(|port| port.name)
        .zip(
            outputs
                .give()
                .into_iter()
                .map(|value| value.map(|value| value.digest())),
        )
        .collect()
}

/// The summaries of all outputs, by port, to pin as a snapshot: `insta::assert_json_snapshot!(testing::summaries(out))`.
/// An output that was not computed is `null`.
pub fn summaries<O: Outputs>(outputs: O) -> serde_json::Value {
    O::specs()
        .iter()
        .zip(outputs.give())
        .map(|(port, value)| {
            let summary = value.map(|value| serde_json::Value::Object(value.summary()));
            (port.name, summary.unwrap_or_default())
        })
        .collect::<Vec<_>>()
        .into_iter()
        .map(|(name, summary)| (name.to_owned(), summary))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

/// Checks what every node promises; see [`Subject::assert_pure`]. `inputs` makes the same inputs anew for each run.
///
/// # Panics
/// If the node breaks a promise, or fails.
pub fn assert_pure<N: Node>(node: &N, inputs: impl Fn() -> N::Inputs + Sync) {
    Subject::new(node).assert_pure(&|| inputs().give());
}

/// Feeds a node the extreme cases that the types of its inputs declare; see [`Subject::assert_extremes`].
///
/// # Panics
/// If the node panics, hangs, or gives a flawed value; with every case in which it does.
pub fn assert_extremes<N: Node>(node: &N) {
    Subject::new(node).assert_extremes();
}

/// Feeds a node the extreme cases of one input at a time, while the others are as given; see
/// [`Subject::assert_extremes_around`]. For nodes that refuse most combinations of extremes.
///
/// # Panics
/// If the node panics, hangs, or gives a flawed value; with every case in which it does.
pub fn assert_extremes_around<N: Node>(node: &N, inputs: N::Inputs) {
    Subject::new(node).assert_extremes_around(&inputs.give());
}

/// [`assert_extremes`] for a registered node type: with its default parameters but for `params`, and with each method of
/// each of its choices. A test over `registry.nodes()` makes sure that no node is left out; `params` (often `{}`) tells it
/// what is quick.
///
/// # Panics
/// As [`assert_extremes`]; and if `params` are refused, or leave out one that must be given.
pub fn assert_type(node_type: &NodeType, params: &serde_json::Value) {
    Subject::assert_all_extremes(&Subject::with_every_method(node_type, params));
}

#[cfg(test)]
mod tests;
