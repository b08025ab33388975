//! What travels on the edges of a graph.

use std::any::Any;

use crate::{AnyValue, Digest, Numerics};

/// Why a stored value could not be written or read.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {cause}")]
pub struct ValueError {
    /// The value's type or file.
    pub what: String,
    /// What was found and what was expected.
    pub cause: String,
}

impl ValueError {
    /// An error about `what`, caused by `cause`.
    pub fn new(what: impl Into<String>, cause: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            cause: cause.into(),
        }
    }
}

/// A short, ordered, human-readable numeric description of a value, for snapshots, diffs and reports.
pub type Summary = serde_json::Map<String, serde_json::Value>;

/// A typed value on an edge: immutable, shared, hashed by content, stored in a format that other tools open.
pub trait Value: Any + Send + Sync + Sized + 'static {
    /// The type's name in graphs and messages, such as `"Image"`.
    const TYPE: &'static str;

    /// What it holds, with units and ranges: its entry in the reference.
    const DOC: &'static str = "";

    /// The file extension of [`Value::encode`]'s format, such as `"exr"`.
    const EXTENSION: &'static str;

    /// The crate that computes with this type and the version of its numerics: part of the key of every node that
    /// has the type at a port. Raised when results change although no node's version did.
    const NUMERICS: Numerics = Numerics::new("", 1);

    /// Digest of the canonical value, not of its encoding.
    fn digest(&self) -> Digest;

    /// Approximate size in memory, in bytes.
    fn size_bytes(&self) -> usize;

    /// Encodes losslessly: `decode(encode(v))` has the digest of `v`.
    fn encode(&self) -> Result<Vec<u8>, ValueError>;

    /// Decodes what [`Value::encode`] wrote. Must not panic on any bytes.
    fn decode(bytes: &[u8]) -> Result<Self, ValueError>;

    /// Shape, range, means: what a person wants to see in a diff.
    fn summary(&self) -> Summary;

    /// What no node may put out, though a file may bring it: a sample that is not finite, a probability of 2. `None` if
    /// the value is sound. The test kit holds every result of a node against it.
    fn flaw(&self) -> Option<String> {
        None
    }

    /// Named extreme cases of this type, for testing nodes: the smallest, the constant, the empty, the huge, and what
    /// is flawed but may come from a file.
    fn extremes() -> Vec<(&'static str, Self)> {
        Vec::new()
    }

    /// This extreme case made to go with another input of the same node, such as a mask resized to a picture's size;
    /// `None` if the two types have nothing to agree on. Without it a node with two rasters would see its extremes
    /// only as sizes that differ.
    fn matched(&self, other: &AnyValue) -> Option<Self> {
        let _ = other;
        None
    }
}
