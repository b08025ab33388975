//! The record of a run (`run.json`).

use serde::Serialize;

use crate::{Numerics, ParamValues, Summary};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunStatus {
    /// All outputs are there.
    Done,
    /// Something failed.
    Failed,
    /// It was interrupted.
    Interrupted,
}

/// Everything about a run.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// Version of this crate.
    pub version: &'static str,
    /// Identifies the run; `gear why` names it.
    pub id: String,
    /// The graph file.
    pub graph: String,
    /// How it ended.
    pub status: RunStatus,
    /// Seconds on the clock.
    pub seconds: f64,
    /// Seconds of the nodes' and loaders' own calls, added up over threads.
    pub node_seconds: f64,
    /// Seconds in which the framework itself was at work: planning, keys, looking up, appending records.
    pub framework_seconds: f64,
    /// Peak memory of the process so far, in bytes.
    pub peak_memory: Option<u64>,
    /// What was planned with.
    pub memory: MemoryReport,
    /// Threads.
    pub jobs: usize,
    /// Whether elisions were allowed.
    pub elision: bool,
    /// The store, and what it cost.
    pub store: StoreReport,
    /// The inputs and nodes, producers first.
    pub nodes: Vec<NodeReport>,
    /// The outputs that were asked for.
    pub outputs: Vec<OutputReport>,
    /// What failed.
    pub failures: Vec<Failure>,
    /// What was odd.
    pub warnings: Vec<String>,
}

/// Memory as the scheduler estimates it: values that are held, and what nodes that run need beside them.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct MemoryReport {
    /// Bytes that the run was to stay under.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<u64>,
    /// Highest estimate, in bytes.
    pub estimated_peak: u64,
    /// How many times a start was held back.
    pub held_back: usize,
}

/// What the store cost, in seconds added up over threads; most of it overlaps the nodes' work.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StoreReport {
    /// Its folder; none if there was no store.
    pub folder: Option<String>,
    /// Taking digests of the inputs' files and of values; also without a store.
    pub hash_seconds: f64,
    /// Encoding and writing values.
    pub write_seconds: f64,
    /// Reading, verifying and decoding values.
    pub read_seconds: f64,
}

/// What became of a node or input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeStatus {
    /// It ran (or was loaded).
    Ran,
    /// Everything needed of it was stored.
    Cached,
    /// Nothing of it was needed.
    LeftOut,
    /// An input given as a value.
    Given,
    /// An optional input that was not given.
    NotGiven,
    /// It failed.
    Failed,
    /// Something that it depends on failed.
    Skipped,
    /// The run was interrupted before.
    Unfinished,
}

/// A node or input in a run.
#[derive(Clone, Debug, Serialize)]
pub struct NodeReport {
    /// Its id, or the input's name.
    pub id: String,
    /// The node type; the value type for an input.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Whether it is a graph input.
    pub input: bool,
    /// What became of it.
    pub status: NodeStatus,
    /// Why it was left out or skipped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Version of the node type or loader.
    pub node_version: u32,
    /// The numerics that its bits depend on besides the version.
    pub numerics: Vec<Numerics>,
    /// Where its bits are valid.
    pub realm: String,
    /// Whether equal inputs give equal bits; what is not so is stored only when asked for.
    pub deterministic: bool,
    /// The file or sample that an input was read from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Parameters, defaults filled in.
    pub params: ParamValues,
    /// Seconds on the clock; what it took when it was first computed, if it was stored.
    pub seconds: f64,
    /// Peak memory of the process while it ran, in bytes; from the time when it was computed, if it was stored.
    pub peak_memory: u64,
    /// Notes for the user.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Its outputs that took part.
    pub outputs: Vec<PortReport>,
    /// Wired ports that were not needed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub elided: Vec<ElidedPort>,
}

/// One output of a node in a run.
#[derive(Clone, Debug, Serialize)]
pub struct PortReport {
    /// The port.
    pub port: String,
    /// The type of its value.
    #[serde(rename = "type")]
    pub type_name: &'static str,
    /// Whether it was known to the store.
    pub hit: bool,
    /// The action's key, in hexadecimal.
    pub key: Option<String>,
    /// The value's digest, in hexadecimal.
    pub digest: Option<String>,
    /// Size of the value in memory, in bytes, if it was there.
    pub bytes: u64,
}

/// A wired port that was not needed for an output.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElidedPort {
    /// The output that did without.
    pub output: String,
    /// The input port.
    pub port: String,
    /// Why.
    pub reason: String,
}

/// An output of the graph.
#[derive(Clone, Debug, Serialize)]
pub struct OutputReport {
    /// Its name.
    pub name: String,
    /// What it is in the graph, `node.port`.
    pub source: String,
    /// The type of its value.
    #[serde(rename = "type")]
    pub type_name: &'static str,
    /// The value's digest, in hexadecimal; none if it is not there.
    pub digest: Option<String>,
}

/// What kind of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureKind {
    /// A file given as input cannot be used: the user's mistake.
    Load,
    /// The node said why.
    Error,
    /// The node panicked: a mistake in the node.
    Panic,
}

/// A node that failed.
#[derive(Clone, Debug, Serialize)]
pub struct Failure {
    /// Its id, or the input's name.
    pub node: String,
    /// Its type.
    #[serde(rename = "type")]
    pub type_name: String,
    /// What kind of failure.
    pub kind: FailureKind,
    /// The message and those of its causes, outermost first.
    pub chain: Vec<String>,
    /// What it was given.
    pub inputs: Vec<InputSummary>,
}

/// What was at an input port of a node that failed.
#[derive(Clone, Debug, Serialize)]
pub struct InputSummary {
    /// The port.
    pub port: String,
    /// Where the value came from, `node.port`.
    pub source: String,
    /// Its type.
    #[serde(rename = "type")]
    pub type_name: &'static str,
    /// Its digest, in hexadecimal.
    pub digest: String,
    /// Its numeric summary.
    pub summary: Summary,
}

impl RunReport {
    /// Adds what a later run of the same graph did for this one.
    pub(super) fn add(&mut self, later: &Self) {
        for node in later.nodes.iter().filter(|node| node.status == NodeStatus::Ran) {
            if let Some(known) = self.nodes.iter_mut().find(|known| known.id == node.id) {
                known.clone_from(node);
            }
        }
        self.seconds += later.seconds;
        self.node_seconds += later.node_seconds;
        self.framework_seconds += later.framework_seconds;
        self.store.hash_seconds += later.store.hash_seconds;
        self.store.write_seconds += later.store.write_seconds;
        self.store.read_seconds += later.store.read_seconds;
        self.peak_memory = self.peak_memory.max(later.peak_memory);
        self.failures.extend(later.failures.iter().cloned());
        self.warnings.extend(later.warnings.iter().cloned());
    }

    /// The node or input of that name.
    pub fn node(&self, id: &str) -> Option<&NodeReport> {
        self.nodes.iter().find(|node| node.id == id)
    }

    /// Names of what ran (or was loaded), in the order of the graph.
    pub fn ran(&self) -> Vec<&str> {
        self.with_status(NodeStatus::Ran)
    }

    /// Names of what has a status.
    pub fn with_status(&self, status: NodeStatus) -> Vec<&str> {
        self.nodes
            .iter()
            .filter(|node| node.status == status)
            .map(|node| node.id.as_str())
            .collect()
    }
}

/// The facts of a summary that are one number or word, or few of them, in words; what is nested is in the record.
fn plain(summary: &Summary) -> String {
    use serde_json::Value;
    let simple = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Bool(_) | Value::Number(_) => Some(value.to_string()),
        _ => None,
    };
    let facts = summary.iter().filter_map(|(name, value)| {
        let told = match value {
            Value::Array(items) if items.len() <= 4 => {
                items.iter().map(simple).collect::<Option<Vec<_>>>()?.join(" × ")
            }
            value => simple(value)?,
        };
        Some(format!("{name} {told}"))
    });
    let facts: String = facts.collect::<Vec<_>>().join(", ");
    match facts.char_indices().nth(160) {
        Some((end, _)) => format!("{}…", &facts[..end]),
        None => facts,
    }
}

impl std::fmt::Display for Failure {
    /// Several lines: what failed, the causes, the inputs.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let what = match self.kind {
            FailureKind::Load => "input",
            FailureKind::Error | FailureKind::Panic => "node",
        };
        let verb = match self.kind {
            FailureKind::Load => "cannot be used",
            FailureKind::Error => "failed",
            FailureKind::Panic => "panicked (a mistake in the node)",
        };
        write!(f, "{what} `{}` ({}) {verb}", self.node, self.type_name)?;
        for (i, cause) in self.chain.iter().enumerate() {
            let lead = if i == 0 { ": " } else { "\n  because: " };
            write!(f, "{lead}{cause}")?;
        }
        for input in &self.inputs {
            write!(f, "\n  {}: {} from {}", input.port, input.type_name, input.source)?;
            let facts = plain(&input.summary);
            if !facts.is_empty() {
                write!(f, ", {facts}")?;
            }
        }
        Ok(())
    }
}
