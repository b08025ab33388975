//! Checked graphs in the store, so that a file that did not change is neither parsed nor checked again.
//!
//! # How it works
//!
//! A graph that checked clean, without even a warning, is written in a compact form (`format`) and kept as a blob of
//! the store:
//!
//! ```text
//! key  = H(format, registry, the file's name and bytes, every --set)
//! blob = names and digests of the files that it extends · inputs · nodes · wires · outputs
//! ```
//!
//! What it extends is not known before it is read, so it stands in the blob: these files are read again, and if one
//! of them has other bytes, the blob does not count. The registry's digest covers every port and parameter of every
//! node type, so that numbers of ports mean what they meant.
//!
//! # What must stay true
//!
//! * The graph is the same as [`GraphSource::check`] would give; tests compare them.
//! * A blob holds *written* parameters, not those with defaults filled in: they are read by the same code, and what a
//!   node's `check` says of them counts.
//! * Nothing in a blob is believed: the store verifies its bytes, every number is checked against what it counts, and
//!   whatever is odd is as if nothing were there.
//! * Places in the text are not kept. A graph with a warning is therefore not kept either: it is read again, and the
//!   warning is shown where it stands.

mod format;

use super::file::File;
use super::{Graph, GraphFile, GraphSource};
use crate::{Digest, Hasher, Registry, Store};

pub(super) use format::write;

/// The graph of a source, if the store has it.
pub(super) fn find(source: &GraphSource, registry: &Registry, store: &Store) -> Option<Graph> {
    let bytes = store.get_blob(&key(source, registry))?;
    let mut graph = format::read(&bytes, registry)?;
    let unchanged = |file: &GraphFile| {
        let text = source.library.read(&file.name);
        text.is_ok_and(|text| Digest::of(text.as_bytes()) == file.digest)
    };
    if !graph.files.iter().all(unchanged) {
        return None;
    }
    graph.files.insert(0, file_of(source));
    graph.name.clone_from(&source.name);
    Some(graph)
}

/// Keeps what [`write`] wrote of a source's graph.
pub(super) fn keep(source: &GraphSource, registry: &Registry, store: &Store, bytes: &[u8]) {
    store.put_blob(&key(source, registry), bytes);
}

fn file_of(source: &GraphSource) -> GraphFile {
    GraphFile {
        name: source.name.clone(),
        digest: Digest::of(source.text.as_bytes()),
    }
}

fn key(source: &GraphSource, registry: &Registry) -> Digest {
    let mut hasher = Hasher::new("compiled graph");
    hasher.u64(format::VERSION).digest(&registry.digest());
    hasher.bytes(source.name.as_bytes()).bytes(source.text.as_bytes());
    for set in &source.set {
        hasher.bytes(set.as_bytes());
    }
    hasher.finish()
}

#[cfg(test)]
mod tests;
