//! What is given to a run: files, bytes made on demand, values.

use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use super::Run;
use crate::graph::nearest;
use crate::{AnyValue, Digest, FileSource, Hasher, NodeError};

type Make = dyn Fn() -> Result<Vec<u8>, NodeError> + Send + Sync;

/// What is given for an input of a graph.
#[derive(Clone)]
pub enum Input {
    /// A file, read by the loader of the input's type.
    File(PathBuf),
    /// Bytes, made only if they are needed, and read by the loader of the input's type.
    Made {
        /// What people call it.
        name: String,
        /// Identifies the bytes: whoever changes what `make` gives must change the key.
        key: Digest,
        /// Makes the bytes.
        make: Arc<Make>,
    },
    /// A value.
    Value(AnyValue),
}

impl Input {
    /// A file on disk.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self::File(path.into())
    }

    /// Bytes made on demand, such as a sample painting. `key` identifies the bytes: a name with a version.
    pub fn made(
        name: impl Into<String>,
        key: &str,
        make: impl Fn() -> Result<Vec<u8>, NodeError> + Send + Sync + 'static,
    ) -> Self {
        Self::Made {
            name: name.into(),
            key: Hasher::new("made").bytes(key.as_bytes()).finish(),
            make: Arc::new(make),
        }
    }
}

impl fmt::Debug for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "File({})", path.display()),
            Self::Made { name, .. } => write!(f, "Made({name})"),
            Self::Value(value) => write!(f, "Value({value:?})"),
        }
    }
}

/// A mistake in how a run was asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RunMistake {
    /// A name that the graph does not have.
    #[error("the graph has no {what} named `{name}`{}", help.as_ref().map(|h| format!("; {h}")).unwrap_or_default())]
    UnknownName {
        /// `input`, `output` or `node`.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest name, or all of them.
        help: Option<String>,
    },
    /// A required input was not given.
    #[error(
        "the graph needs the input `{name}` ({type_name}), which was not given; give it with `--input {name}=FILE`"
    )]
    MissingInput {
        /// Its name.
        name: String,
        /// Its type.
        type_name: &'static str,
    },
    /// A file cannot be read.
    #[error("input `{name}`: {}: {problem}", path.display())]
    BadFile {
        /// The input.
        name: String,
        /// The file.
        path: PathBuf,
        /// What was found.
        problem: String,
    },
    /// The system starts not even one thread.
    #[error("no thread can be started ({cause}); allow more processes (`ulimit -u`) or more memory (`ulimit -v`)")]
    NoThread {
        /// What the system said.
        cause: String,
    },
    /// The run was interrupted while its inputs were read.
    #[error("interrupted while the inputs were read; nothing was computed")]
    Interrupted,
    /// A value of another type, or a file for a type that no loader reads.
    #[error("input `{name}`: {problem}")]
    BadValue {
        /// The input.
        name: String,
        /// What was found.
        problem: String,
    },
}

/// What an input turned out to be.
#[derive(Clone)]
pub(super) enum Given {
    Absent,
    /// What the loader reads, and the digest of its bytes.
    Source {
        source: Source,
        digest: Digest,
    },
    Value(AnyValue),
}

#[derive(Clone)]
pub(super) enum Source {
    File {
        path: PathBuf,
        /// Of the file and of those beside it; `None` for one that is not there.
        stamps: Vec<(PathBuf, Option<Stamp>)>,
    },
    Made {
        name: String,
        make: Arc<Make>,
    },
}

/// What tells that a file changed while it was read.
pub(super) type Stamp = (u64, Option<SystemTime>);

impl Source {
    pub fn name(&self) -> String {
        match self {
            Self::File { path, .. } => path.display().to_string(),
            Self::Made { name, .. } => name.clone(),
        }
    }

    /// Bytes of the file; 0 where it is not known before it is made.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::File { stamps, .. } => stamps.iter().filter_map(|(_, stamp)| *stamp).map(|stamp| stamp.0).sum(),
            Self::Made { .. } => 0,
        }
    }

    pub fn open(&self) -> Result<FileSource, NodeError> {
        Ok(match self {
            Self::File { path, .. } => FileSource::path(path),
            Self::Made { name, make } => FileSource::bytes(name, make()?),
        })
    }

    /// An error if the file, or one beside it, is not the one whose digest was taken.
    pub fn still_the_same(&self) -> Result<(), NodeError> {
        let Self::File { stamps, .. } = self else { return Ok(()) };
        let changed = |(path, stamp): &(PathBuf, Option<Stamp>)| match (stamp_of(path), stamp) {
            (Ok(now), Some(before)) => now != *before,
            (Ok(_), None) => true,
            (Err(_), _) => false,
        };
        if stamps.iter().any(changed) {
            return Err(NodeError::new("the file changed while it was read; run again"));
        }
        Ok(())
    }
}

fn stamp_of(path: &Path) -> std::io::Result<Stamp> {
    let meta = std::fs::metadata(path)?;
    Ok((meta.len(), meta.modified().ok()))
}

/// Whether an output that is asked for may need each input of the graph. Of an output that is not there nothing is known:
/// it may need all of them.
fn needed(run: &Run<'_>) -> Vec<bool> {
    let graph = run.graph;
    let known = |name: &String| graph.outputs().iter().any(|output| output.name == *name);
    if !run.outputs.iter().flatten().all(known) {
        return vec![true; graph.inputs().len()];
    }
    let asked = graph.outputs().iter().filter(|output| run.asks_for(&output.name));
    let mut stack: Vec<u32> = asked.map(|output| graph.site_of[output.slot as usize]).collect();
    let mut needed = vec![false; graph.sites()];
    while let Some(site) = stack.pop() {
        if !std::mem::replace(&mut needed[site as usize], true) {
            let wires = graph.wires_of(site).iter();
            stack.extend(wires.map(|wire| graph.site_of[wire.from as usize]));
        }
    }
    needed.truncate(graph.inputs().len());
    needed
}

/// Matches what was given with what the graph has; all mistakes at once. An input that nothing needs need not be given.
pub(super) fn resolve(run: &Run<'_>) -> Result<Vec<Given>, Vec<RunMistake>> {
    let graph = run.graph;
    let mut mistakes = Vec::new();
    let mut unknown = |what: &'static str, name: &str, names: Vec<&str>| {
        let help = match nearest(name, names.iter().copied()) {
            Some(near) => Some(format!("did you mean `{near}`?")),
            None if names.is_empty() => None,
            None => Some(format!("it has {}", names.join(", "))),
        };
        mistakes.push(RunMistake::UnknownName {
            what,
            name: name.to_string(),
            help,
        });
    };
    let inputs: Vec<_> = graph.inputs().iter().map(|input| input.name.as_str()).collect();
    let outputs: Vec<_> = graph.outputs().iter().map(|output| output.name.as_str()).collect();
    let nodes: Vec<_> = graph
        .nodes()
        .iter()
        .map(|node| node.id.as_str())
        .chain(inputs.iter().copied())
        .collect();
    for name in run.inputs.keys().filter(|name| !inputs.contains(&name.as_str())) {
        unknown("input", name, inputs.clone());
    }
    for name in run
        .outputs
        .iter()
        .flatten()
        .filter(|name| !outputs.contains(&name.as_str()))
    {
        unknown("output", name, outputs.clone());
    }
    for name in run.fresh.iter().filter(|name| !nodes.contains(&name.as_str())) {
        unknown("node", name, nodes.clone());
    }
    let mut given = Vec::new();
    for (input, needed) in graph.inputs().iter().zip(needed(run)) {
        let mistake = match run.inputs.get(&input.name) {
            None if input.optional || !needed => {
                given.push(Given::Absent);
                continue;
            }
            None => RunMistake::MissingInput {
                name: input.name.clone(),
                type_name: input.value_type.name,
            },
            Some(Input::Value(value)) if value.value_type() == input.value_type => {
                given.push(Given::Value(value.clone()));
                continue;
            }
            Some(Input::Value(value)) => RunMistake::BadValue {
                name: input.name.clone(),
                problem: format!("expected {}, found {}", input.value_type.name, value.value_type().name),
            },
            Some(_) if input.load.is_none() => RunMistake::BadValue {
                name: input.name.clone(),
                problem: format!("no loader reads files of type {}", input.value_type.name),
            },
            Some(Input::Made { name, key, make }) => {
                given.push(Given::Source {
                    source: Source::Made {
                        name: name.clone(),
                        make: Arc::clone(make),
                    },
                    digest: *key,
                });
                continue;
            }
            Some(Input::File(path)) => {
                let beside = input.load.as_ref().map(|loader| loader.beside(path));
                match hash_files(path, beside.unwrap_or_default(), run.cancel.flag()) {
                    Err(_) if run.cancel.is_raised() => return Err(vec![RunMistake::Interrupted]),
                    Ok((digest, stamps)) => {
                        given.push(Given::Source {
                            source: Source::File {
                                path: path.clone(),
                                stamps,
                            },
                            digest,
                        });
                        continue;
                    }
                    Err((path, problem)) => RunMistake::BadFile {
                        name: input.name.clone(),
                        path,
                        problem,
                    },
                }
            }
        };
        mistakes.push(mistake);
    }
    if mistakes.is_empty() { Ok(given) } else { Err(mistakes) }
}

/// A file and those beside it that are there: their digest, which is that of the file alone if none is, and stamps.
#[allow(clippy::type_complexity, reason = "a pair, named by the sentence above")]
fn hash_files(
    path: &Path,
    beside: Vec<PathBuf>,
    cancel: &AtomicBool,
) -> Result<(Digest, Vec<(PathBuf, Option<Stamp>)>), (PathBuf, String)> {
    let hash = |path: &Path| hash_file(path, cancel).map_err(|problem| (path.to_path_buf(), problem));
    let (mut digest, stamp) = hash(path)?;
    let mut stamps = vec![(path.to_path_buf(), Some(stamp))];
    for (number, path) in beside.into_iter().enumerate() {
        if !path.exists() {
            stamps.push((path, None));
            continue;
        }
        let (other, stamp) = hash(&path)?;
        digest = Hasher::new("file and beside it")
            .digest(&digest)
            .u64(number as u64)
            .digest(&other)
            .finish();
        stamps.push((path, Some(stamp)));
    }
    Ok((digest, stamps))
}

fn hash_file(path: &Path, cancel: &AtomicBool) -> Result<(Digest, Stamp), String> {
    let open = || -> std::io::Result<(Digest, Stamp)> {
        let kind = std::fs::metadata(path)?.file_type();
        if kind.is_dir() {
            return Err(std::io::Error::other("this is a folder, expected a file"));
        }
        // A pipe can be read only once, a device without end; an input is read twice.
        if !kind.is_file() {
            return Err(std::io::Error::other("this is no regular file; save it to one first"));
        }
        let mut file = std::fs::File::open(path)?;
        let stamp = stamp_of(path)?;
        let mut hasher = blake3::Hasher::new();
        let mut piece = vec![0; 1 << 20];
        loop {
            if cancel.load(Ordering::Relaxed) {
                return Err(std::io::Error::other("interrupted"));
            }
            match file.read(&mut piece) {
                Ok(0) => break,
                Ok(read) => hasher.update(&piece[..read]),
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
        }
        let digest = Digest(*hasher.finalize().as_bytes());
        Ok((Hasher::new("file").digest(&digest).finish(), stamp))
    };
    match open() {
        Ok((_, (0, _))) => Err("the file is empty".to_string()),
        Ok(hashed) => Ok(hashed),
        Err(error) => Err(match error.kind() {
            std::io::ErrorKind::NotFound => "there is no such file".to_string(),
            _ => error.to_string(),
        }),
    }
}
