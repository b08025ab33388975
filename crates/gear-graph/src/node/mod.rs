//! What a node is: a pure function with named, typed ports.

mod context;
mod demand;
mod error;
mod ports;
mod resources;
mod unfinished;

pub use context::{Context, Progress};
pub(crate) use demand::KnownPort;
pub use demand::{Demand, Known};
pub use error::NodeError;
pub(crate) use ports::NOT_DEMANDED;
pub use ports::{InputField, Inputs, Lazy, OutputField, Outputs, PortSpec, Slot, Slots, Want, Wanted};
pub use resources::Resources;
pub use unfinished::Unfinished;

use std::path::{Path, PathBuf};

use crate::{Params, Value};

/// A crate and the version of its numerics: raised when its results change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct Numerics {
    /// The crate, such as `"gear-image"`; empty for a type without numerics of its own.
    pub name: &'static str,
    /// Its version.
    pub version: u32,
}

impl Numerics {
    /// The numerics of the crate `name` at `version`.
    pub const fn new(name: &'static str, version: u32) -> Self {
        Self { name, version }
    }
}

/// A node type. `Self` holds the parameters.
///
/// A node is a pure function of its parameters and its inputs: no clock, no file, no environment, the same bits for
/// any number of threads. What it computes for one output must not depend on which other outputs are wanted.
pub trait Node: Params {
    /// The name in graph files, such as `"LogRatio"`.
    const NAME: &'static str;

    /// Raised when results change. Part of the key of every result.
    const VERSION: u32;

    /// The numerics that the node computes with, beyond those of the types at its ports (these count anyway).
    const USES: &'static [Numerics] = &[];

    /// Whether equal inputs give equal bits on every run. A node that cannot promise this says `false`; it is shown as
    /// such, and its results are not stored unless the run asks for it ([`crate::Run::cache_nondeterministic`]).
    const DETERMINISTIC: bool = true;

    /// Whether results are stored without being asked for. A node that asks a service says `true` although it is not
    /// deterministic: its answer was paid for and stands until somebody asks afresh ([`crate::Run::fresh`]).
    const KEPT: bool = Self::DETERMINISTIC;

    /// The input ports.
    type Inputs: Inputs;

    /// The output ports.
    type Outputs: Outputs;

    /// Where the bits of a result are valid: `"cpu"` everywhere, or `"gpu:adapter:driver"`, `"service:model"`, ….
    /// It may depend on what the run lends.
    fn realm(&self, resources: &Resources) -> String {
        let _ = resources;
        "cpu".to_string()
    }

    /// Bytes that a run holds at most besides its inputs, outputs included, as a run with a memory limit counts them.
    ///
    /// `inputs` are the bytes of the values at every input port, in order of the ports; 0 where nothing is. `None`
    /// leaves it to the framework, which takes twice what the inputs hold.
    fn memory(&self, inputs: &[u64]) -> Option<u64> {
        let _ = inputs;
        None
    }

    /// Checks what one parameter's range cannot say, such as `low <= high`.
    ///
    /// Errors are made by [`NodeError::param`], which names the parameter at fault.
    fn check(&self) -> Result<(), NodeError> {
        Ok(())
    }

    /// What `output` needs beyond the ports that are always needed (`Arc<T>`, `Option<Arc<T>>`), given what is known.
    ///
    /// A pure function of the parameters, `output` and the values it takes from `known`; it is asked again with
    /// more known until it says [`Demand::Ready`]. By default every lazy port that is wired is needed.
    fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
        let _ = output;
        Ok(match known.lazy_unknown() {
            ports if ports.is_empty() => Demand::ready(),
            ports => Demand::Need {
                ports,
                reason: "always read".into(),
            },
        })
    }

    /// Computes the wanted outputs.
    fn run(&self, inputs: Self::Inputs, want: &Want, ctx: &Context) -> Result<Self::Outputs, NodeError>;
}

/// What turns a file given as a graph input into a value. `Self` holds the parameters (`with:` of the input).
pub trait Loader: Params {
    /// Raised when the same file gives another value.
    const VERSION: u32;

    /// The numerics it computes with, beyond those of its value's type.
    const USES: &'static [Numerics] = &[];

    /// The type of the input.
    type Value: Value;

    /// Checks what one parameter's range cannot say.
    fn check(&self) -> Result<(), NodeError> {
        Ok(())
    }

    /// Files that belong to the file at `path` and are read with it, such as a description beside it. Those that are
    /// there are part of what identifies the input.
    fn beside(&self, path: &Path) -> Vec<PathBuf> {
        let _ = path;
        Vec::new()
    }

    /// Reads the file. An error is shown to the user as a mistake in what was given: name what was found and what
    /// was expected; the framework adds the file's name.
    fn load(&self, file: &FileSource, ctx: &Context) -> Result<Self::Value, NodeError>;
}

/// A file that a [`Loader`] reads: on disk, or bytes in memory.
#[derive(Clone, Debug)]
pub struct FileSource {
    name: String,
    place: Place,
}

#[derive(Clone, Debug)]
enum Place {
    Disk(PathBuf),
    Memory(std::sync::Arc<[u8]>),
}

impl FileSource {
    /// A file on disk.
    pub fn path(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        Self {
            name: path.display().to_string(),
            place: Place::Disk(path),
        }
    }

    /// Bytes in memory, shown to people as `name`.
    pub fn bytes(name: impl Into<String>, bytes: impl Into<std::sync::Arc<[u8]>>) -> Self {
        Self {
            name: name.into(),
            place: Place::Memory(bytes.into()),
        }
    }

    /// The name that people know it by. It must not change the value.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The path, if it is on disk.
    pub fn as_path(&self) -> Option<&Path> {
        match &self.place {
            Place::Disk(path) => Some(path),
            Place::Memory(_) => None,
        }
    }

    /// The whole content.
    pub fn read(&self) -> std::io::Result<std::sync::Arc<[u8]>> {
        match &self.place {
            Place::Disk(path) => std::fs::read(path).map(Into::into),
            Place::Memory(bytes) => Ok(bytes.clone()),
        }
    }

    /// A reader over the content.
    pub fn open(&self) -> std::io::Result<Box<dyn ReadSeek + '_>> {
        Ok(match &self.place {
            Place::Disk(path) => Box::new(std::io::BufReader::new(std::fs::File::open(path)?)),
            Place::Memory(bytes) => Box::new(std::io::Cursor::new(&bytes[..])),
        })
    }
}

/// A reader that can seek.
pub trait ReadSeek: std::io::BufRead + std::io::Seek {}

impl<T: std::io::BufRead + std::io::Seek> ReadSeek for T {}
