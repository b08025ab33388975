//! The store: what was computed, kept on disk by content, shared by processes.
//!
//! # What is kept
//!
//! ```text
//! actions-1.log          records, appended only: Done, Need, Blob (the number is the format's version)
//! origins-1.log          what every key was made of, and by which run; appended only, read only to explain
//! contents/ab/ab12….exr  encoded values, named by the checksum of their bytes
//! tmp/                   contents that are being written
//! lock                   held shared to append, exclusively to collect garbage
//! ```
//!
//! A **Done** record says: the action with this key gave the value with this digest (of the canonical value), whose
//! encoding is that content (or stands in the record itself, when it is small). A **Need** record says: at this key
//! the action asked for these ports. A **Blob** record names any bytes by a key.
//!
//! # What must stay true
//!
//! 1. A content is complete under its name before a record that mentions it is appended, and it never changes: it is
//!    written to `tmp/` and renamed, and its name is its checksum. Two processes that write the same content write
//!    the same bytes; whoever comes second changes nothing.
//! 2. A record is one checksummed unit. A batch is appended with one write to a file opened for appending, so
//!    batches of several processes do not interleave; a torn batch at a crash is skipped up to the next record that
//!    verifies.
//! 3. Nothing read is believed: a record must verify, a content must have the checksum that is its name, a decoded
//!    value must have the digest that the record promised. What does not is a miss and a warning, never a result.
//! 4. A missing content is a miss only for who needs the value. Its digest is still good: keys are made of digests.
//! 5. The folder's lock is taken before the lock of a store's own state, never while that is held: otherwise a thread
//!    that appends and one that mends the log would wait for each other. A run at work does not wait for it at all
//!    ([`Store::try_flush`]): another process may collect garbage for minutes.
//! 6. No error of the disk is an error of the run. The store then stops writing, says so once, and the run goes on.
//!
//! # At a crash
//!
//! | killed | left behind | next run |
//! |---|---|---|
//! | while a content is written | a file in `tmp/` | not seen; removed by a later `gc` |
//! | after the rename, before the append | a content without a record | computed again; the same file is met |
//! | within the append | a torn last record | skipped with a warning, computed again |
//! | while `gc` removes contents | records without their contents | misses for who needs the values |
//! | while `gc` rewrites the log | the old log, and a file in `tmp/` | as if it had not run |

mod archive;
mod bytes;
mod contents;
mod gc;
mod log;
mod origin;
mod record;
mod stat;
mod unfinished;
mod verify;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

pub use archive::{ArchiveError, Archived};
pub use gc::Collected;
pub(crate) use origin::{Origin, Parts, PortPart};
pub(crate) use record::{Content, Done, Need, Record};
pub use stat::{StoreStat, TypeStat};
pub(crate) use unfinished::UnfinishedAction;
pub use verify::Verified;

use crate::{AnyValue, Digest, Hasher, ValueType};
use contents::Contents;
use log::Log;

/// Bytes that a store takes at most, if nothing else is said.
pub const DEFAULT_STORE_LIMIT: u64 = 8 << 30;

/// Bytes up to which an encoded value stands in its record.
const INLINE: usize = 4096;

/// A store on disk. All methods may be called from any thread; none fails: what cannot be read is a miss, what
/// cannot be written is lost, and [`Store::warnings`] says so.
pub struct Store {
    root: PathBuf,
    limit: u64,
    contents: Contents,
    /// Opened to look at it only.
    looks: bool,
    inner: Mutex<Inner>,
}

struct Inner {
    log: Log,
    warnings: Vec<String>,
    /// Nothing is written any more.
    read_only: bool,
    /// Bytes of contents and logs, as far as this process knows.
    bytes: u64,
    /// Bytes of the log of origins when it was opened.
    origins: u64,
    /// The keys that were looked up, if somebody wants to know.
    asked: Option<Vec<Digest>>,
}

impl Store {
    /// Opens the store in a folder, which is made if it is not there.
    pub fn open(root: impl Into<PathBuf>) -> Self {
        Self::opened(root.into(), false)
    }

    /// Opens the store in a folder to look at it: nothing there is made, written, removed or marked as used. Where
    /// there is no store, it is an empty one.
    pub fn look_at(root: impl Into<PathBuf>) -> Self {
        Self::opened(root.into(), true)
    }

    fn opened(root: PathBuf, looks: bool) -> Self {
        let mut warnings = Vec::new();
        let mut read_only = looks;
        if !looks && let Err(error) = contents::prepare(&root) {
            read_only = true;
            warnings.push(format!(
                "the store {} cannot be written ({error}); results of this run are not kept",
                root.display()
            ));
        }
        let log = Log::read(&root, &mut warnings);
        let origins = std::fs::metadata(log::origins_path(&root)).map_or(0, |meta| meta.len());
        let bytes = log.bytes() + origins;
        Self {
            contents: Contents::new(&root, !looks),
            looks,
            root,
            limit: DEFAULT_STORE_LIMIT,
            inner: Mutex::new(Inner {
                log,
                warnings,
                read_only,
                bytes,
                origins,
                asked: None,
            }),
        }
    }

    /// Sets the bytes that the store takes at most; above it, a run ends with a collection ([`Store::gc`]).
    pub fn with_limit(mut self, bytes: u64) -> Self {
        self.limit = bytes;
        self
    }

    /// The platform's folder for the store: `$GEAR_STORE`, or `gear` in the cache folder of the user.
    pub fn default_path() -> Option<PathBuf> {
        let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        set("GEAR_STORE").or_else(|| {
            let cache = set("XDG_CACHE_HOME").filter(|p| p.is_absolute()).or_else(|| {
                if cfg!(windows) {
                    set("LOCALAPPDATA")
                } else if cfg!(target_os = "macos") {
                    set("HOME").map(|home| home.join("Library/Caches"))
                } else {
                    set("HOME").map(|home| home.join(".cache"))
                }
            });
            cache.map(|cache| cache.join("gear"))
        })
    }

    /// Whether there is a store in a folder.
    pub fn exists(root: &Path) -> bool {
        contents::is_store(root)
    }

    /// Something in a folder that is no store, so that whoever asks people for a folder can refuse to make one among their
    /// files; none if it is a store, is empty or is not there.
    pub fn in_the_way(root: &Path) -> Option<String> {
        contents::foreign(root)
    }

    /// Bytes that the store takes at most.
    pub fn limit(&self) -> u64 {
        self.limit
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// What went wrong since the last call.
    pub fn warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.inner().warnings)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is known at a key.
    pub(crate) fn lookup(&self, key: &Digest) -> Option<Record> {
        let mut inner = self.inner();
        let found = inner.log.find(key);
        if let (Some(asked), true) = (&mut inner.asked, found.is_some()) {
            asked.push(*key);
        }
        found
    }

    /// Remembers from now on which keys are looked up and found.
    pub(crate) fn listen(&self) {
        self.inner().asked = Some(Vec::new());
    }

    /// The keys that were looked up and found since [`Store::listen`].
    pub(crate) fn heard(&self) -> Vec<Digest> {
        self.inner().asked.take().unwrap_or_default()
    }

    /// Keeps where a result came from. Its record is published after it.
    pub(crate) fn publish_origin(&self, origin: &Origin) {
        let mut inner = self.inner();
        if !inner.read_only {
            inner.log.push_origin(origin);
        }
    }

    /// Where everything came from that was ever computed into this store and is still known, oldest first.
    pub(crate) fn origins(&self) -> Vec<Origin> {
        self.flush();
        match log::read_origins(&self.root) {
            Ok((origins, _)) => origins,
            Err(error) => {
                let path = log::origins_path(&self.root);
                let warning = format!("the store's {} cannot be read ({error})", path.display());
                self.inner().warnings.push(warning);
                Vec::new()
            }
        }
    }

    /// Whether the value with this digest is in the store, as far as records say.
    pub(crate) fn has_value(&self, value: &Digest) -> bool {
        self.inner()
            .log
            .find_value(value)
            .is_some_and(|done| done.content.is_some_and(|content| self.contents.exists(&content)))
    }

    /// The value with this digest, verified.
    pub fn load(&self, value: &Digest, value_type: &ValueType) -> Option<AnyValue> {
        let content = self.inner().log.find_value(value)?.content?;
        self.load_from(&content, value, value_type)
    }

    /// The value with this digest, if it is so small that it stands in its record.
    pub(crate) fn load_small(&self, value: &Digest, value_type: &ValueType) -> Option<AnyValue> {
        let content = self.inner().log.find_value(value)?.content?;
        match content {
            Content::Inline(_) => self.load_from(&content, value, value_type),
            Content::File { .. } => None,
        }
    }

    fn load_from(&self, content: &Content, value: &Digest, value_type: &ValueType) -> Option<AnyValue> {
        let bytes = self.read(content)?;
        // A decoder is promised not to panic on any bytes, and these are the bytes that were encoded; but a panic
        // here must not cost the run.
        let decoded = std::panic::catch_unwind(|| value_type.decode(&bytes));
        let problem = match decoded {
            Ok(Ok(decoded)) if decoded.digest() == *value => return Some(decoded),
            Ok(Ok(_)) => "is another value than was stored".to_string(),
            Ok(Err(error)) => format!("cannot be decoded ({error})"),
            Err(_) => "made the decoder panic".to_string(),
        };
        self.distrust(content, &problem);
        None
    }

    /// Encodes a value and keeps it. `None` if it could not be kept.
    pub(crate) fn keep(&self, value: &AnyValue) -> Option<Content> {
        if self.inner().read_only {
            return None;
        }
        match value.encode() {
            Ok(bytes) => self.keep_bytes(bytes, value.value_type().extension),
            Err(error) => {
                self.inner().warnings.push(format!("a value cannot be stored: {error}"));
                None
            }
        }
    }

    fn keep_bytes(&self, bytes: Vec<u8>, extension: &str) -> Option<Content> {
        if bytes.len() <= INLINE {
            return Some(Content::Inline(bytes));
        }
        if self.inner().read_only {
            return None;
        }
        match self.contents.write(&bytes, extension) {
            Ok((content, new)) => {
                if new {
                    self.inner().bytes += bytes.len() as u64;
                }
                Some(content)
            }
            Err(error) => {
                self.stop_writing(&error);
                None
            }
        }
    }

    /// Records what an action gave. Its content must have been kept before.
    pub(crate) fn publish(&self, record: Record) {
        let mut inner = self.inner();
        if !inner.read_only {
            inner.log.push(&record);
        }
    }

    /// Records are appended in batches; this writes what has gathered. Waits while another process writes the logs
    /// anew, which takes as long as it takes to collect garbage.
    pub fn flush(&self) {
        self.flush_unless(&|| false);
    }

    /// The same, but no longer waits once `stop` says so; whether everything is written.
    pub fn flush_unless(&self, stop: &dyn Fn() -> bool) -> bool {
        // An error has stopped the writing: then nothing is left to write.
        let written = patiently(|| Ok(self.try_flush().then_some(())), stop);
        written.is_ok_and(|written| written.is_some())
    }

    /// The same without waiting: what cannot be written now is written by a later call. Whether nothing is left.
    pub(crate) fn try_flush(&self) -> bool {
        let waits = |inner: &Inner| !inner.read_only && inner.log.pending_bytes() > 0;
        if !waits(&self.inner()) {
            return true;
        }
        let folder = match log::try_lock_shared(&self.root) {
            Ok(None) => return false,
            Ok(Some(folder)) => Ok(folder),
            Err(error) => Err(error),
        };
        let mut inner = self.inner();
        if !waits(&inner) {
            return true;
        }
        match folder.and_then(|_folder| inner.log.append(&self.root)) {
            Ok(written) => inner.bytes += written,
            Err(error) => {
                drop(inner);
                self.stop_writing(&error);
            }
        }
        true
    }

    /// Bytes of records that wait to be written.
    pub(crate) fn pending_bytes(&self) -> usize {
        self.inner().log.pending_bytes()
    }

    /// Keeps any bytes under a key; for artefacts that are made from values, such as pictures and pages.
    pub fn put_blob(&self, key: &Digest, bytes: &[u8]) {
        if let Some(content) = self.keep_bytes(bytes.to_vec(), "bin") {
            self.publish(Record::Blob {
                key: blob_key(key),
                content,
            });
            self.try_flush();
        }
    }

    /// Whether bytes are kept under a key, as far as records and the folder say; they are verified when they are read.
    pub fn has_blob(&self, key: &Digest) -> bool {
        match self.lookup(&blob_key(key)) {
            Some(Record::Blob { content, .. }) => self.contents.exists(&content),
            _ => false,
        }
    }

    /// As [`Store::put_blob`]; what was kept under the key before, and nowhere else, goes.
    pub(crate) fn replace_blob(&self, key: &Digest, bytes: &[u8]) {
        let before = self.lookup(&blob_key(key));
        self.put_blob(key, bytes);
        let now = self.lookup(&blob_key(key));
        if let (Some(Record::Blob { content: before, .. }), Some(Record::Blob { content: now, .. })) = (before, now)
            && before != now
            && let Content::File { bytes, .. } = before
        {
            self.contents.remove(&before);
            let mut inner = self.inner();
            inner.bytes = inner.bytes.saturating_sub(bytes);
        }
    }

    /// The bytes kept under a key, verified.
    pub fn get_blob(&self, key: &Digest) -> Option<Vec<u8>> {
        let Some(Record::Blob { content, .. }) = self.lookup(&blob_key(key)) else {
            return None;
        };
        self.read(&content)
    }

    fn read(&self, content: &Content) -> Option<Vec<u8>> {
        match self.contents.read(content) {
            Ok(bytes) => bytes,
            Err(problem) => {
                self.distrust(content, &problem);
                None
            }
        }
    }

    /// Warns of a content that is not what its name says, and removes it, so that it can be written again.
    fn distrust(&self, content: &Content, problem: &str) {
        if let Content::File { .. } = content {
            let path = match self.looks {
                true => self.contents.place(content),
                false => self.contents.remove(content),
            };
            self.inner().warnings.push(format!(
                "the store's {} {problem}; it is computed again",
                path.display()
            ));
        }
    }

    fn stop_writing(&self, error: &io::Error) {
        let mut inner = self.inner();
        if !inner.read_only {
            inner.read_only = true;
            let warning = format!(
                "the store {} cannot be written ({error}); further results of this run are not kept",
                self.root.display()
            );
            inner.warnings.push(warning);
        }
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        // Whoever must not lose a record has flushed before; a process must not hang when it ends.
        let until = Instant::now() + A_MOMENT;
        self.flush_unless(&|| Instant::now() > until);
    }
}

/// As long as nobody minds to wait.
const A_MOMENT: Duration = Duration::from_millis(300);

/// Tries again and again, until it succeeds, fails, or `stop` says so.
fn patiently<T>(attempt: impl Fn() -> io::Result<Option<T>>, stop: &dyn Fn() -> bool) -> io::Result<Option<T>> {
    loop {
        match attempt()? {
            None if stop() => return Ok(None),
            None => std::thread::sleep(Duration::from_millis(10)),
            done => return Ok(done),
        }
    }
}

/// Blobs live among actions; their keys must not meet.
fn blob_key(key: &Digest) -> Digest {
    Hasher::new("blob").digest(key).finish()
}

#[cfg(test)]
mod tests;
