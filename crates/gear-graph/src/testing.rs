//! What a node author tests a node with: one node, run on plain values.

use crate::{Context, Fields, Node, NodeError, Outputs, Params, Problem, Span, Tree, Value, Want};

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
    let mut problems = Vec::new();
    let tree = Tree::from_json(params);
    let read = Fields::new(Some(&tree), Span::default(), "the node under test", &mut problems)
        .and_then(|mut fields| P::read(&mut fields));
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

/// Checks what every node promises: the same bits on 1, 2 and 8 threads and on a second run, and the same value of an
/// output whichever others are wanted.
///
/// # Panics
/// If the node breaks a promise, or fails.
pub fn assert_pure<N: Node>(node: &N, inputs: impl Fn() -> N::Inputs + Sync) {
    let once = |threads: usize, want: &Want| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a thread pool");
        let outputs = pool.install(|| node.run(inputs(), want, &Context::detached()));
        digests(outputs.unwrap_or_else(|error| panic!("{} failed: {error}", N::NAME)))
    };
    let all = Want::all::<N::Outputs>();
    let first = once(1, &all);
    for threads in [1, 2, 8] {
        assert_eq!(
            first,
            once(threads, &all),
            "{} on {threads} threads gives other bits",
            N::NAME
        );
    }
    for (port, digest) in &first {
        let alone = once(2, &Want::only::<N::Outputs>(&[port]));
        let found = alone
            .iter()
            .find(|(name, _)| name == port)
            .and_then(|(_, digest)| *digest);
        assert_eq!(
            *digest,
            found,
            "output `{port}` of {} depends on what else is wanted",
            N::NAME
        );
    }
}

/// Checks what every value type promises: encoding loses nothing, and garbage is an error, not a panic.
///
/// # Panics
/// If the type breaks a promise.
pub fn assert_codec<T: Value>(values: impl IntoIterator<Item = T>) {
    let extremes = T::extremes().into_iter().map(|(_, value)| value);
    for value in values.into_iter().chain(extremes) {
        let bytes = value
            .encode()
            .unwrap_or_else(|error| panic!("a {} does not encode: {error}", T::TYPE));
        let back = T::decode(&bytes).unwrap_or_else(|error| panic!("a {} does not decode: {error}", T::TYPE));
        assert_eq!(back.digest(), value.digest(), "a {} changed by encoding", T::TYPE);
        for cut in [0, 1, bytes.len() / 2, bytes.len().saturating_sub(1)] {
            // Truncated bytes may happen to be a value; they must not be a crash.
            let _ = T::decode(&bytes[..cut.min(bytes.len())]);
        }
    }
    let _ = T::decode(b"not a value");
}
