//! What a store holds.

use std::collections::BTreeMap;
use std::fs;
use std::time::UNIX_EPOCH;

use super::gc::files;
use super::record::{Content, Record};
use super::{Store, log};

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct StoreStat {
    /// Recorded actions.
    pub actions: usize,
    /// Recorded demands.
    pub demands: usize,
    /// Artefacts kept by key.
    pub blobs: usize,
    /// Files with contents.
    pub contents: usize,
    /// Bytes of contents.
    pub content_bytes: u64,
    /// Bytes of the logs.
    pub log_bytes: u64,
    /// Bytes that the store takes at most.
    pub limit: u64,
    /// When the oldest and the newest action was done, in seconds since 1970.
    pub made: Option<(u64, u64)>,
    /// When the content that was used longest ago was used, in seconds since 1970.
    pub least_recently_used: Option<u64>,
    /// What there is of every type of value.
    pub types: BTreeMap<String, TypeStat>,
}

/// What a store holds of one type of value.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct TypeStat {
    /// Actions that gave such a value.
    pub actions: usize,
    /// Values that are kept.
    pub values: usize,
    /// Their bytes; equal contents count once.
    pub bytes: u64,
    /// Seconds that it took to compute the actions.
    pub seconds: f64,
}

impl Store {
    /// What the store holds, counted on disk.
    pub fn stat(&self) -> StoreStat {
        let records = log::Log::read(&self.root, &mut Vec::new()).records();
        let files = files(&self.root.join("contents"));
        let mut stat = StoreStat {
            contents: files.len(),
            content_bytes: files.iter().map(|(_, meta)| meta.len()).sum(),
            log_bytes: log::bytes_on_disk(&self.root),
            limit: self.limit,
            least_recently_used: files
                .iter()
                .filter_map(|(_, meta)| Some(meta.modified().ok()?.duration_since(UNIX_EPOCH).ok()?.as_secs()))
                .min(),
            ..StoreStat::default()
        };
        let mut counted = std::collections::BTreeSet::new();
        for record in &records {
            match record {
                Record::Need(_) => stat.demands += 1,
                Record::Blob { .. } => stat.blobs += 1,
                Record::Done(done) => {
                    stat.actions += 1;
                    let (first, last) = stat.made.unwrap_or((done.made, done.made));
                    stat.made = Some((first.min(done.made), last.max(done.made)));
                    let of_type = stat.types.entry(done.type_name.clone()).or_default();
                    of_type.actions += 1;
                    of_type.seconds += done.seconds;
                    match &done.content {
                        Some(Content::Inline(bytes)) => {
                            of_type.values += 1;
                            of_type.bytes += bytes.len() as u64;
                        }
                        Some(Content::File {
                            checksum, extension, ..
                        }) => {
                            let path = self.contents.path(checksum, extension);
                            if let Ok(meta) = fs::metadata(path) {
                                of_type.values += 1;
                                of_type.bytes += if counted.insert(*checksum) { meta.len() } else { 0 };
                            }
                        }
                        None => {}
                    }
                }
            }
        }
        stat
    }
}
