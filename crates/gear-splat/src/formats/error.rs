//! Why a scene could not be read or written.

use crate::SceneError;

use super::Format;

/// What [`super::read`] takes, for messages.
pub(super) const READABLE: &str = "3DGS PLY, PlayCanvas compressed PLY, SPZ or .splat";

/// Why a scene could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The file system refused.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// A folder.
    #[error("is a folder; expected a file with a Gaussian scene ({READABLE})")]
    Folder,
    /// More bytes than are read.
    #[error("the file has {found} bytes; at most {most} are read")]
    TooLarge {
        /// Its length.
        found: u64,
        /// The limit.
        most: u64,
    },
    /// There are no bytes.
    #[error("the file is empty; expected a Gaussian scene ({READABLE})")]
    Empty,
    /// A file of another kind.
    #[error("this is {found}; expected a Gaussian scene ({READABLE}); {help}")]
    Foreign {
        /// What it looks like.
        found: &'static str,
        /// What to do.
        help: &'static str,
    },
    /// Nothing that is known.
    #[error("the file begins with {found} and is no Gaussian scene that gear knows; expected {READABLE}")]
    Unknown {
        /// The first bytes.
        found: String,
    },
    /// The header is not one of this format.
    #[error("not a {format} file: {cause}")]
    Header {
        /// The format that it began like.
        format: Format,
        /// What was found, and what was expected.
        cause: String,
    },
    /// The vertices of a PLY file lack an attribute of a Gaussian.
    #[error(
        "no property `{missing}` in the vertices; this PLY file is not a Gaussian scene in the 3DGS layout (found: {found})"
    )]
    MissingProperty {
        /// The first one that is missing.
        missing: String,
        /// Those that are there.
        found: String,
    },
    /// `f_rest` has a length that no SH degree has.
    #[error("found {0} f_rest properties; expected 0, 9, 24 or 45 (SH degree 0 to 3)")]
    RestCount(usize),
    /// The file ends early.
    #[error(
        "{format}: the header promises {promised} {unit}, the file has room for {room}; it is truncated, get it again"
    )]
    Truncated {
        /// The format.
        format: Format,
        /// What the header says.
        promised: u64,
        /// Of what: vertices, Gaussians, chunks.
        unit: &'static str,
        /// What the bytes that are there can hold.
        room: u64,
    },
    /// The data cannot be what the format says.
    #[error("{format}: {cause}")]
    Data {
        /// The format.
        format: Format,
        /// What was found, and what was expected.
        cause: String,
    },
    /// More Gaussians than are read or written.
    #[error("{format}: {found} Gaussians; expected at most {most}")]
    TooMany {
        /// The format.
        format: Format,
        /// How many there are.
        found: u64,
        /// How many there may be.
        most: u64,
    },
    /// A variant of the format that is not read.
    #[error("{format}: {found} is not supported; {help}")]
    Unsupported {
        /// The format.
        format: Format,
        /// What was found.
        found: String,
        /// What is supported, or what to do.
        help: &'static str,
    },
    /// The format is only written.
    #[error("{format} is written, not read; expected {READABLE}")]
    WriteOnly {
        /// The format.
        format: Format,
    },
    /// The format is only read.
    #[error("{format} is read, not written; write {help}")]
    ReadOnly {
        /// The format.
        format: Format,
        /// What is written instead.
        help: &'static str,
    },
    /// A scene of no Gaussians, and the format has no file for that.
    #[error("the scene has no valid Gaussian, and a {format} file needs one; write .ply")]
    NoGaussians {
        /// The format.
        format: Format,
    },
    /// The scene cannot be written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The canonical camera has no meaning.
    #[error("the canonical camera has numbers that are not finite, or no pixels")]
    Camera,
}
