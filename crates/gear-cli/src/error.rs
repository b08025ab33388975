//! What can go wrong, and how the process ends then.

use std::path::PathBuf;

use gear_graph::{Mistakes, RunMistake, Unreadable};
use gear_splat::DeviceError;

/// How the process ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Everything is done: 0.
    Done,
    /// A node failed, or a result could not be written: 1.
    Failed,
    /// Something in the command or its files must be mended: 2.
    Mistake,
    /// Ctrl-C: 130.
    Interrupted,
}

/// Why a command did not do what it was asked for.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The graph file cannot be read.
    #[error("{0}")]
    GraphFile(#[from] Unreadable),
    /// No graph of that name comes with gear.
    #[error("no graph named `{name}` comes with gear; {help}")]
    UnknownGraph {
        /// As given.
        name: String,
        /// The nearest name, or all of them.
        help: String,
    },
    /// No node of that name is known.
    #[error("there is no node named `{name}`; {help}")]
    UnknownNode {
        /// As given.
        name: String,
        /// The nearest name, or all of them.
        help: String,
    },
    /// The graph has mistakes.
    #[error("{0}")]
    Graph(Mistakes),
    /// An `--input` is not of the form `NAME=PATH`.
    #[error("--input {given}: expected NAME=PATH or NAME=sample:NAME, such as `painting=scroll.png`")]
    InputForm {
        /// As given.
        given: String,
    },
    /// The extreme cases cannot be run as asked for.
    #[error("{cause}")]
    Stress {
        /// Why.
        cause: String,
    },
    /// Snapshots cannot be compared as asked for.
    #[error("{cause}")]
    Snap {
        /// Why.
        cause: String,
    },
    /// Snapshots cannot be written.
    #[error("{cause}")]
    SnapFiles {
        /// Why.
        cause: String,
    },
    /// A ballot cannot be made or counted.
    #[error(transparent)]
    Ballot(#[from] gear_study::ballot::BallotError),
    /// A GPU is required and there is none.
    #[error("{0}; without GEAR_REQUIRE_GPU=1 the CPU does it")]
    Device(DeviceError),
    /// An input is given twice.
    #[error("--input {name}: given more than once")]
    InputTwice {
        /// Its name.
        name: String,
    },
    /// The sample cannot be painted.
    #[error("{asked}: {cause}")]
    Sample {
        /// The flag or argument.
        asked: String,
        /// Why.
        cause: gear_sample::SampleError,
    },
    /// A sample has nothing of that type.
    #[error(
        "--input {name}=sample:{sample}: a sample gives an Image, a Mask, a Field or a Scene, and `{name}` is a {value_type}"
    )]
    SampleType {
        /// The input.
        name: String,
        /// The sample.
        sample: String,
        /// The type of the input.
        value_type: &'static str,
    },
    /// There is no store where one was looked for.
    #[error("{}", no_store(path.as_deref()))]
    NoStore {
        /// The folder; none if the machine has no cache folder.
        path: Option<PathBuf>,
    },
    /// The store cannot be read or changed.
    #[error("the store {}: {cause}", path.display())]
    Store {
        /// Its folder.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// An archive of a store cannot be written or taken.
    #[error("{0}")]
    Archive(gear_graph::ArchiveError),
    /// An archive would hold nothing.
    #[error("{}", nothing_to_export(path, graph.as_deref()))]
    NothingToExport {
        /// The folder of the store.
        path: PathBuf,
        /// The graph whose run was asked for.
        graph: Option<String>,
    },
    /// A folder that is no store, and holds what is not gear's.
    #[error("--store {}: this folder is no store and is not empty: it holds `{holds}`; name a new or an empty folder, or a store", path.display())]
    NotForAStore {
        /// The folder.
        path: PathBuf,
        /// Something in it.
        holds: String,
    },
    /// The run was asked for in a way that cannot be.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Run(Vec<RunMistake>),
    /// The output folder cannot be written.
    #[error("--out {}: {cause}", folder.display())]
    OutFolder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        cause: String,
    },
    /// The run needs what is not installed.
    #[error("this run needs nodes of plugins that are not installed; nothing was computed\n{}", .needed.join("\n"))]
    PluginsAbsent {
        /// A line a node: what it needs and how to have it.
        needed: Vec<String>,
    },
    /// A new node cannot be written.
    #[error(transparent)]
    NewNode(#[from] crate::commands::new_node::Refusal),
    /// A new plugin cannot be written.
    #[error(transparent)]
    NewPlugin(#[from] crate::commands::new_plugin::Refusal),
    /// A folder is no plugin that can be used.
    #[error("--plugin {}: {cause}", folder.display())]
    Plugin {
        /// The folder.
        folder: PathBuf,
        /// Why.
        cause: gear_plugin::PluginError,
    },
    /// A scene file cannot be read, or not be made.
    #[error("{}: {cause}", file.display())]
    SceneFile {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: gear_splat::formats::FormatError,
    },
    /// A name that says no format.
    #[error("{}: the name says no format; expected {}", file.display(), gear_splat::formats::Format::WRITTEN)]
    SceneName {
        /// The file.
        file: PathBuf,
    },
    /// A scene would be converted onto itself.
    #[error("{}: is the input; give the output another name", file.display())]
    OntoItself {
        /// The file.
        file: PathBuf,
    },
    /// A camera file has no cameras that can be used.
    #[error("--camera {}: {cause}", file.display())]
    CameraFile {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: String,
    },
    /// A picture that is too large.
    #[error("{name}: {cause}; set it with --size")]
    PictureSize {
        /// The picture.
        name: String,
        /// Why.
        cause: String,
    },
    /// A curve cannot be measured.
    #[error(transparent)]
    Curve(#[from] gear_study::curve::run::CurveError),
    /// A table of a curve cannot be read.
    #[error("{file}: {cause}")]
    CurveTable {
        /// The file.
        file: String,
        /// Why.
        cause: gear_study::curve::table::BadTable,
    },
    /// A record of a run cannot be read.
    #[error(transparent)]
    Record(#[from] gear_study::diff::BadRecord),
    /// A file is in the way.
    #[error("{}: exists already; remove it, or copy elsewhere with --to DIR", file.display())]
    InTheWay {
        /// The file.
        file: PathBuf,
    },
    /// A result would replace a file that gear did not write.
    #[error("{}: no earlier run wrote this, and a result would replace it; choose another folder with --out, or replace it with --force", file.display())]
    Taken {
        /// The file.
        file: PathBuf,
    },
    /// A result could not be written.
    #[error("{}: cannot be written: {cause}; no half of it stands under that name", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The system starts not even one thread.
    #[error("no thread can be started ({cause}); allow more processes (`ulimit -u`) or more memory (`ulimit -v`)")]
    NoThreads {
        /// What the system said.
        cause: String,
    },
    /// Standard output does not take what is written to it.
    #[error("standard output cannot be written: {cause}")]
    StandardOutput {
        /// Why.
        cause: std::io::Error,
    },
    /// A result could not be turned into a file.
    #[error("the output `{output}` cannot be written: {cause}")]
    Encode {
        /// The output.
        output: String,
        /// Why.
        cause: String,
    },
}

impl CliError {
    /// How the process ends.
    pub fn exit(&self) -> Exit {
        match self {
            Self::Write { .. }
            | Self::StandardOutput { .. }
            | Self::Encode { .. }
            | Self::Store { .. }
            | Self::SnapFiles { .. } => Exit::Failed,
            Self::Curve(gear_study::curve::run::CurveError::Interrupted) => Exit::Interrupted,
            Self::Curve(_) => Exit::Failed,
            Self::Run(mistakes) if mistakes.contains(&RunMistake::Interrupted) => Exit::Interrupted,
            Self::NoThreads { .. } => Exit::Failed,
            Self::Run(mistakes) if mistakes.iter().any(|m| matches!(m, RunMistake::NoThread { .. })) => Exit::Failed,
            _ => Exit::Mistake,
        }
    }
}

fn nothing_to_export(path: &std::path::Path, graph: Option<&str>) -> String {
    let store = path.display();
    match graph {
        None => format!("the store {store} is empty; nothing was written. `gear run` fills it"),
        Some(graph) => format!(
            "the store {store} holds nothing of {graph} as it was asked for; nothing was written. Give the --input and --set that \
             it was run with, or `gear run` it first"
        ),
    }
}

fn no_store(path: Option<&std::path::Path>) -> String {
    let Some(path) = path else {
        return "there is no cache folder here; name the store with --store DIR".to_owned();
    };
    let what = match std::fs::metadata(path) {
        Err(_) => "there is nothing",
        Ok(meta) if meta.is_dir() => "this folder was not made by gear",
        Ok(_) => "this is a file",
    };
    format!(
        "{} is no store: {what}; `gear run --store DIR` makes one",
        path.display()
    )
}
