//! Snapshots: what chosen ports of a graph gave, kept beside the graph, and compared.
//!
//! A graph says what is pinned (`snapshots:`, see [`gear_graph::graph::GraphSnapshot`]): a port, a norm, a tolerance. Beside
//! `pipeline.yaml` stands the folder `pipeline.snapshots` with, for each snapshot,
//!
//! ```text
//! NAME.json   the port, the type, the inputs it was made from, the digest, and numbers
//! NAME.exr    a small raster, from which the norm is taken; none for reports and numbers
//! NAME.png    the same to look at
//! ```
//!
//! The digest decides first: equal digests are equal values, so that a check with a warm store loads no value at all.
//! Only where they differ is the value reduced and measured (`reduce`, `compare`).
//!
//! | state | meaning | what ends the check |
//! |---|---|---|
//! | same | the same bits | |
//! | within | other bits, within the tolerance | |
//! | moved | beyond the tolerance, or another shape | yes |
//! | missing | nothing is pinned yet | yes |
//! | stale | pinned from another port, type, size or input than the graph has now, or unreadable | yes |
//! | failed | there is no value: a node failed | yes |
//! | unknown | a file whose snapshot the graph does not have | no, but told |

pub mod compare;
mod page;
pub mod reduce;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use gear_graph::graph::GraphSnapshot;
use gear_graph::{Graph, Outcome};
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use compare::Moved;
pub use page::page;
use reduce::{Raster, Reduced, reduce};

/// The version of what is kept.
const VERSION: u32 = 1;

/// Why snapshots cannot be compared or written.
#[derive(Debug, thiserror::Error)]
pub enum SnapError {
    /// A picture cannot be made.
    #[error("a picture cannot be made: {cause}")]
    Picture {
        /// Why.
        cause: String,
    },
    /// A file cannot be written or removed.
    #[error("{}: {cause}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The page cannot be made.
    #[error("the page cannot be made: {0}")]
    Page(#[from] minijinja::Error),
    /// Pinned snapshots were made from different inputs.
    #[error(
        "the snapshots in {} were made from different inputs: `{name}` is {a} and {b}; give it with --input, and accept \
         them all anew",
        folder.display()
    )]
    Inputs {
        /// The folder.
        folder: PathBuf,
        /// The input.
        name: String,
        /// What one says.
        a: String,
        /// What another says.
        b: String,
    },
}

/// `NAME.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Pinned {
    snapshot: u32,
    port: String,
    #[serde(rename = "type")]
    type_name: String,
    /// What was given for the inputs of the graph, as on the command line; files by their path from the graph's folder.
    inputs: BTreeMap<String, String>,
    size: usize,
    digest: String,
    numbers: Json,
}

/// What became of a snapshot.
#[derive(Clone, Debug)]
pub enum State {
    /// The same bits.
    Same,
    /// Other bits, this far, within the tolerance.
    Within(f64),
    /// This far, beyond the tolerance.
    Moved(f64),
    /// Another shape: what changed.
    Reshaped(String),
    /// Nothing is pinned.
    Missing,
    /// What is pinned is of something else: why.
    Stale(String),
    /// There is no value.
    Failed,
}

impl State {
    /// Whether a check passes.
    pub fn passes(&self) -> bool {
        matches!(self, Self::Same | Self::Within(_))
    }
}

/// A snapshot of the graph, compared with what is pinned.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Its name.
    pub name: String,
    /// The port, `node.port`.
    pub port: String,
    /// The norm's name.
    pub norm: &'static str,
    /// How far it may move.
    pub tolerance: f64,
    /// What became of it.
    pub state: State,
    /// The numbers that moved.
    pub numbers: Vec<compare::Number>,
    pinned: Option<Reduced>,
    found: Option<Reduced>,
    record: Option<Pinned>,
}

/// All snapshots of a graph, compared.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// In the order of the graph.
    pub snapshots: Vec<Compared>,
    /// Names of pinned snapshots that the graph does not have.
    pub unknown: Vec<String>,
}

/// The folder of a graph file's snapshots: `a/b.yaml` → `a/b.snapshots`.
pub fn folder_of(graph: &Path) -> PathBuf {
    graph.with_extension("snapshots")
}

/// The inputs that the pinned snapshots of a folder were made from.
pub fn pinned_inputs(folder: &Path) -> Result<BTreeMap<String, String>, SnapError> {
    let mut inputs: BTreeMap<String, String> = BTreeMap::new();
    for name in pinned_names(folder) {
        let Ok(pinned) = read(folder, &name) else { continue };
        for (input, given) in pinned.inputs {
            match inputs.get(&input) {
                Some(before) if *before != given => {
                    return Err(SnapError::Inputs {
                        folder: folder.to_path_buf(),
                        name: input,
                        a: before.clone(),
                        b: given,
                    });
                }
                _ => inputs.insert(input, given),
            };
        }
    }
    Ok(inputs)
}

/// Compares what a run gave with what is pinned. `graph` has its snapshots as outputs ([`Graph::into_snapshots`]);
/// `inputs` is what the run was given.
pub fn compare(
    graph: &Graph,
    outcome: &Outcome<'_>,
    folder: &Path,
    inputs: &BTreeMap<String, String>,
) -> Result<Comparison, SnapError> {
    let mut known = BTreeSet::new();
    let mut snapshots = Vec::new();
    for snapshot in graph.snapshots() {
        known.insert(snapshot.name.clone());
        snapshots.push(one(graph, snapshot, outcome, folder, inputs));
    }
    let unknown = pinned_names(folder)
        .into_iter()
        .filter(|name| !known.contains(name))
        .collect();
    Ok(Comparison { snapshots, unknown })
}

fn one(
    graph: &Graph,
    snapshot: &GraphSnapshot,
    outcome: &Outcome<'_>,
    folder: &Path,
    inputs: &BTreeMap<String, String>,
) -> Compared {
    let mut compared = Compared {
        name: snapshot.name.clone(),
        port: graph.snapshot_source(snapshot),
        norm: snapshot.norm.name(),
        tolerance: snapshot.tolerance,
        state: State::Failed,
        numbers: Vec::new(),
        pinned: None,
        found: None,
        record: None,
    };
    let Some(digest) = outcome.digest(&snapshot.name) else {
        return compared;
    };
    let mut record = Pinned {
        snapshot: VERSION,
        port: compared.port.clone(),
        type_name: graph.snapshot_type(snapshot).name.to_owned(),
        inputs: inputs.clone(),
        size: snapshot.size,
        digest: digest.hex(),
        numbers: Json::Null,
    };
    let path = folder.join(format!("{}.json", snapshot.name));
    let pinned = match path.exists() {
        true => read(folder, &snapshot.name).map(Some),
        false => Ok(None),
    };
    if let Ok(Some(pinned)) = &pinned
        && pinned.digest == record.digest
        && why_stale(pinned, &record).is_none()
    {
        compared.state = State::Same;
        return compared;
    }
    let Some(value) = outcome.value(&snapshot.name) else {
        return compared;
    };
    let found = reduce(&value, snapshot.size);
    record.numbers = found.numbers.clone();
    compared.state = match pinned {
        Ok(None) => State::Missing,
        Err(why) => State::Stale(why),
        Ok(Some(pinned)) => match raster(folder, &snapshot.name) {
            Err(why) => State::Stale(why),
            Ok(raster) => {
                let before = Reduced {
                    raster,
                    numbers: pinned.numbers.clone(),
                };
                let state = match (
                    why_stale(&pinned, &record),
                    compare::moved(&before, &found, snapshot.norm),
                ) {
                    (Some(why), _) => State::Stale(why),
                    (None, Moved::Shape(what)) => State::Reshaped(what),
                    (None, Moved::By(distance)) if distance <= snapshot.tolerance => State::Within(distance),
                    (None, Moved::By(distance)) => State::Moved(distance),
                };
                compared.numbers = compare::numbers(&before.numbers, &found.numbers);
                compared.pinned = Some(before);
                state
            }
        },
    };
    compared.found = Some(found);
    compared.record = Some(record);
    compared
}

/// Why what is pinned is no snapshot of what the graph says now.
fn why_stale(pinned: &Pinned, now: &Pinned) -> Option<String> {
    let mut changed = Vec::new();
    if pinned.port != now.port {
        changed.push(format!("of {}, the graph says {}", pinned.port, now.port));
    }
    if pinned.type_name != now.type_name {
        changed.push(format!("of a {}, the port gives a {}", pinned.type_name, now.type_name));
    }
    if pinned.size != now.size {
        changed.push(format!("at {} px, the graph says {}", pinned.size, now.size));
    }
    if pinned.inputs != now.inputs {
        changed.push(format!(
            "from {}, the run has {}",
            listed(&pinned.inputs),
            listed(&now.inputs)
        ));
    }
    (!changed.is_empty()).then(|| format!("pinned {}", changed.join("; ")))
}

fn listed(inputs: &BTreeMap<String, String>) -> String {
    let inputs: Vec<_> = inputs.iter().map(|(name, given)| format!("{name}={given}")).collect();
    if inputs.is_empty() {
        "no inputs".to_owned()
    } else {
        inputs.join(", ")
    }
}

/// Pins what was found: the snapshots of these names. The files that were written.
pub fn accept(comparison: &Comparison, folder: &Path, names: &BTreeSet<String>) -> Result<Vec<PathBuf>, SnapError> {
    let mut written = Vec::new();
    let mut write = |file: String, bytes: &[u8]| {
        let file = folder.join(file);
        let failed = |cause| SnapError::File {
            file: file.clone(),
            cause,
        };
        std::fs::create_dir_all(folder).map_err(failed)?;
        gear_image::io::write_atomically(&file, bytes).map_err(|e| failed(std::io::Error::other(e.to_string())))?;
        written.push(file);
        Ok::<(), SnapError>(())
    };
    for snapshot in comparison.snapshots.iter().filter(|s| names.contains(&s.name)) {
        let (Some(found), Some(record)) = (&snapshot.found, &snapshot.record) else {
            continue;
        };
        let name = &snapshot.name;
        if let Some(raster) = &found.raster {
            write(format!("{name}.exr"), &raster.encode()?)?;
            let picture = raster
                .picture()
                .map_err(|e| SnapError::Picture { cause: e.to_string() })?;
            write(format!("{name}.png"), &picture.bytes)?;
        } else {
            remove(folder, name, &["exr", "png"])?;
        }
        // Last: a record is believed, so what it speaks of must be there.
        let text = serde_json::to_string_pretty(record).map_err(|e| SnapError::Picture { cause: e.to_string() })?;
        write(format!("{name}.json"), (text + "\n").as_bytes())?;
    }
    Ok(written)
}

/// Removes the files of a snapshot.
pub fn forget(folder: &Path, name: &str) -> Result<(), SnapError> {
    remove(folder, name, &["json", "exr", "png"])
}

fn remove(folder: &Path, name: &str, extensions: &[&str]) -> Result<(), SnapError> {
    for extension in extensions {
        let file = folder.join(format!("{name}.{extension}"));
        match std::fs::remove_file(&file) {
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => return Err(SnapError::File { file, cause }),
            _ => {}
        }
    }
    Ok(())
}

fn pinned_names(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| {
        let path = entry.path();
        let json = path.extension().is_some_and(|extension| extension == "json");
        json.then(|| path.file_stem().map(|stem| stem.to_string_lossy().into_owned()))?
    });
    names.collect()
}

fn read(folder: &Path, name: &str) -> Result<Pinned, String> {
    let file = folder.join(format!("{name}.json"));
    let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let pinned: Pinned = serde_json::from_slice(&bytes).map_err(|e| format!("{}: {e}", file.display()))?;
    match pinned.snapshot {
        VERSION => Ok(pinned),
        other => Err(format!("{} is of version {other}, expected {VERSION}", file.display())),
    }
}

fn raster(folder: &Path, name: &str) -> Result<Option<Raster>, String> {
    let file = folder.join(format!("{name}.exr"));
    match std::fs::read(&file) {
        Ok(bytes) => Raster::decode(&bytes)
            .map(Some)
            .map_err(|e| format!("{}: {e}", file.display())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(format!("{}: {e}", file.display())),
    }
}

/// A line of the table: state, name, how far, the tolerance, and what to know.
pub fn line(snapshot: &Compared) -> String {
    let limit = format!("{} ≤ {:e}", snapshot.norm, snapshot.tolerance);
    let (state, what) = match &snapshot.state {
        State::Same => ("same", "the same bits".to_owned()),
        State::Within(distance) => ("within", format!("moved by {distance:.2e} ({limit})")),
        State::Moved(distance) => ("MOVED", format!("by {distance:.2e} ({limit})")),
        State::Reshaped(what) => ("MOVED", what.clone()),
        State::Missing => ("MISSING", "nothing is pinned".to_owned()),
        State::Stale(why) => ("STALE", why.clone()),
        State::Failed => ("FAILED", "there is no value".to_owned()),
    };
    format!("{:<16} {state:<8} {:<24} {what}", snapshot.name, snapshot.port)
}

/// Lines that tell the numbers which moved most, these first, at most so many; what is no number any more, or was none,
/// comes before them.
pub fn moved_most(numbers: &[compare::Number], most: usize) -> Vec<String> {
    let by = |number: &compare::Number| match (number.before.as_f64(), number.after.as_f64()) {
        (Some(before), Some(after)) => (before - after).abs(),
        _ => f64::INFINITY,
    };
    let mut sorted: Vec<&compare::Number> = numbers.iter().collect();
    sorted.sort_by(|a, b| by(b).total_cmp(&by(a)));
    let lines = sorted.iter().take(most).map(|number| {
        let (before, after) = told_apart(&number.before, &number.after);
        format!("{}: {before} → {after}", number.path)
    });
    let mut lines: Vec<_> = lines.collect();
    match numbers.len().saturating_sub(most) {
        0 => {}
        more => lines.push(format!("… and {more} more")),
    }
    lines
}

/// Two values with five digits, or with as many as tell them apart.
fn told_apart(before: &Json, after: &Json) -> (String, String) {
    let text = |json: &Json, digits: usize| match json.as_f64() {
        Some(number) => {
            // Rounded in decimal, and written as JSON writes the rounded number.
            let rounded: f64 = format!("{number:.*e}", digits - 1).parse().unwrap_or(number);
            Json::from(rounded).to_string().trim_end_matches(".0").to_owned()
        }
        None => json.to_string(),
    };
    for digits in 5..17 {
        let both = (text(before, digits), text(after, digits));
        if both.0 != both.1 {
            return both;
        }
    }
    (before.to_string(), after.to_string())
}

#[cfg(test)]
mod tests;
