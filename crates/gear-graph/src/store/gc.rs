//! Keeping the store within its size: what took long to compute and is small stays longest.

use std::collections::HashMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use super::contents::{Contents, new_file};
use super::origin::Origin;
use super::record::{Content, Record};
use super::{A_MOMENT, Store, log, patiently};
use crate::Digest;

/// What a collection removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Collected {
    /// Files removed.
    pub files: usize,
    /// Their bytes.
    pub bytes: u64,
    /// Bytes of contents and log left.
    pub left: u64,
}

/// Files that belong to nobody are left alone for so long: another process may be about to record them.
const GRACE: Duration = Duration::from_secs(3600);

/// The log is read as a whole by every process; beyond this size it is rewritten, and half of it dropped at most.
const LOG_LIMIT: u64 = 128 << 20;

/// The same for the log of origins, which runs do not read.
const ORIGINS_LIMIT: u64 = 128 << 20;

struct Kept {
    path: PathBuf,
    bytes: u64,
    /// Seconds of work per byte, the less the longer it was not read.
    worth: f64,
}

impl Store {
    /// What a run does at its end: collects garbage if the store has grown beyond its limit, as far as this process
    /// knows, and mends a damaged log, so that its damage is told of once and not by every run. Where another process
    /// is at the store for longer than a moment, a later run does it.
    pub fn tidy(&self) -> io::Result<Option<Collected>> {
        let inner = self.inner();
        if inner.read_only {
            return Ok(None);
        }
        let full = inner.bytes > self.limit || inner.log.len() > LOG_LIMIT || inner.origins > ORIGINS_LIMIT;
        let damaged = inner.log.damaged > 0;
        drop(inner);
        if !full && !damaged {
            return Ok(None);
        }
        let until = Instant::now() + A_MOMENT;
        let folder = patiently(|| log::try_lock_exclusive(&self.root), &|| Instant::now() > until)?;
        let Some(_folder) = folder else {
            return Ok(None);
        };
        if full {
            let collected = self.collect(self.limit)?;
            self.inner().bytes = collected.left;
            return Ok(Some(collected));
        }
        self.mend()?;
        Ok(None)
    }

    /// Writes the logs anew without what is damaged in them, for one who holds the folder's lock alone.
    pub(super) fn mend(&self) -> io::Result<()> {
        let records = log::Log::read(&self.root, &mut Vec::new()).records();
        self.rewrite(records, u64::MAX)?;
        self.rewrite_origins(u64::MAX)?;
        self.inner().log.damaged = 0;
        Ok(())
    }

    /// Removes contents, least worth first, until contents and log take at most nine tenths of `limit`; then
    /// rewrites the log with the latest record of every key. Actions whose contents were removed stay known by their
    /// digests. Other processes wait to append meanwhile; what they have open stays good.
    pub fn gc(&self, limit: u64) -> io::Result<Collected> {
        self.flush();
        let _folder = log::lock_exclusive(&self.root)?;
        self.collect(limit)
    }

    /// The same, for one who holds the folder's lock alone.
    fn collect(&self, limit: u64) -> io::Result<Collected> {
        let records = log::Log::read(&self.root, &mut Vec::new()).records();
        let seconds = seconds_of(&records);
        let now = SystemTime::now();
        let mut collected = Collected::default();
        let mut kept = Vec::new();
        let logs = log::bytes_on_disk(&self.root);
        let mut total = logs;
        for (path, meta) in files(&self.root.join("contents")) {
            if Contents::named(&path).is_none() {
                continue; // not ours
            }
            let age = meta
                .modified()
                .ok()
                .and_then(|time| now.duration_since(time).ok())
                .unwrap_or_default();
            let known = seconds.get(path.file_stem().and_then(|s| s.to_str()).unwrap_or_default());
            if known.is_none() && age > GRACE {
                remove(&path, meta.len(), &mut collected);
                continue;
            }
            total += meta.len();
            let days = age.as_secs_f64() / 86_400.0;
            kept.push(Kept {
                path,
                bytes: meta.len(),
                worth: known.copied().unwrap_or(0.0) / (meta.len() as f64 + 1.0) / (1.0 + days),
            });
        }
        for (path, meta) in files(&self.root.join("tmp")) {
            if meta
                .modified()
                .is_ok_and(|time| now.duration_since(time).is_ok_and(|age| age > GRACE))
            {
                remove(&path, meta.len(), &mut collected);
            }
        }
        kept.sort_by(|a, b| a.worth.total_cmp(&b.worth).then_with(|| a.path.cmp(&b.path)));
        for content in kept {
            if total <= limit / 10 * 9 {
                break;
            }
            total -= content.bytes;
            remove(&content.path, content.bytes, &mut collected);
        }
        let actions = self.rewrite(records, (limit / 4).min(LOG_LIMIT / 2))?;
        let origins = self.rewrite_origins((limit / 16).min(ORIGINS_LIMIT / 2))?;
        collected.left = total - logs + actions + origins;
        Ok(collected)
    }

    /// Writes the records that are worth keeping into a new log, at most `limit` bytes, latest first; its size.
    pub(super) fn rewrite(&self, records: Vec<Record>, limit: u64) -> io::Result<u64> {
        let still_there = records.into_iter().filter_map(|mut record| {
            let gone = log::content(&record).is_some_and(|content| !self.contents.exists(content));
            match &mut record {
                Record::Done(done) if gone => done.content = None,
                Record::Blob { .. } if gone => return None,
                _ => {}
            }
            Some(record)
        });
        let still_there: Vec<_> = still_there.collect();
        self.replace(&log::path(&self.root), &latest(&still_there, Record::write, limit))
    }

    /// The same for origins.
    pub(super) fn rewrite_origins(&self, limit: u64) -> io::Result<u64> {
        let (origins, _) = log::read_origins(&self.root)?;
        let path = log::origins_path(&self.root);
        if origins.is_empty() && !path.exists() {
            return Ok(0);
        }
        self.replace(&path, &latest(&origins, Origin::write, limit))
    }

    /// Puts a new file in the place of a log; its size.
    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<u64> {
        if bytes.is_empty() {
            // An empty log would look as if it had been lost.
            return match fs::remove_file(path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
                _ => Ok(0),
            };
        }
        let mut file = new_file("log-", &self.root.join("tmp"))?;
        file.write_all(bytes)?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(bytes.len() as u64)
    }

    /// Removes everything that the store put into its folder.
    pub fn clear(&self) -> io::Result<Collected> {
        self.flush();
        let _folder = log::lock_exclusive(&self.root)?;
        let mut collected = Collected::default();
        for (path, meta) in files(&self.root.join("contents")) {
            if Contents::named(&path).is_some() {
                remove(&path, meta.len(), &mut collected);
            }
        }
        for log in [log::path(&self.root), log::origins_path(&self.root)] {
            let bytes = fs::metadata(&log).map_or(0, |meta| meta.len());
            remove(&log, bytes, &mut collected);
        }
        Ok(collected)
    }
}

/// The frames of the last records that fit into `limit` bytes, in their order.
fn latest<T>(records: &[T], write: impl Fn(&T, &mut Vec<u8>), limit: u64) -> Vec<u8> {
    let mut frames = Vec::new();
    let mut total = 0;
    for record in records.iter().rev() {
        let mut bytes = Vec::new();
        write(record, &mut bytes);
        total += bytes.len() as u64;
        if total > limit {
            break;
        }
        frames.push(bytes);
    }
    frames.into_iter().rev().flatten().collect()
}

/// Seconds of work behind every content, by the checksum that is its name.
fn seconds_of(records: &[Record]) -> HashMap<String, f64> {
    let mut seconds = HashMap::new();
    let mut add = |checksum: &Digest, s: f64| {
        let entry = seconds.entry(checksum.hex()).or_insert(0.0f64);
        *entry = entry.max(s);
    };
    for record in records {
        match (record, log::content(record)) {
            (Record::Done(done), Some(Content::File { checksum, .. })) => add(checksum, done.seconds),
            // A blob is made from values in moments; a second is a fair guess.
            (Record::Blob { .. }, Some(Content::File { checksum, .. })) => add(checksum, 1.0),
            _ => {}
        }
    }
    seconds
}

fn remove(path: &Path, bytes: u64, collected: &mut Collected) {
    if fs::remove_file(path).is_ok() {
        collected.files += 1;
        collected.bytes += bytes;
    }
}

/// The files of a folder and of its folders, sorted.
pub(super) fn files(root: &Path) -> Vec<(PathBuf, fs::Metadata)> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(folder) else { continue };
        for entry in entries.flatten() {
            match entry.metadata() {
                Ok(meta) if meta.is_dir() => folders.push(entry.path()),
                Ok(meta) if meta.is_file() => found.push((entry.path(), meta)),
                _ => {}
            }
        }
    }
    found.sort_by(|(a, _), (b, _)| a.cmp(b));
    found
}
