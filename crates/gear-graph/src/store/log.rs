//! The log of actions: read once, then appended to.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::hash::{BuildHasherDefault, Hasher};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::bytes::{FRAME, frames};
use super::origin::Origin;
use super::record::{Content, Done, Record};
use crate::Digest;

/// A change of the format changes the name, so that another version's log is a clean miss.
pub const ACTIONS: &str = "actions-1.log";

/// The same for the log of origins, which runs only write.
pub const ORIGINS: &str = "origins-1.log";

pub fn path(root: &Path) -> PathBuf {
    root.join(ACTIONS)
}

pub fn origins_path(root: &Path) -> PathBuf {
    root.join(ORIGINS)
}

/// Bytes of the two logs on disk.
pub fn bytes_on_disk(root: &Path) -> u64 {
    let size = |path: PathBuf| fs::metadata(path).map_or(0, |meta| meta.len());
    size(path(root)) + size(origins_path(root))
}

/// Keys are digests: their first bytes are as good a hash as any.
#[derive(Default)]
pub struct FirstBytes(u64);

impl Hasher for FirstBytes {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        if let Some(first) = bytes.first_chunk() {
            self.0 ^= u64::from_le_bytes(*first);
        }
    }

    fn write_usize(&mut self, _: usize) {} // the length of the array, always the same
}

type Index = HashMap<Digest, (usize, usize), BuildHasherDefault<FirstBytes>>;

/// All records: the bytes of the log as it was when it was opened and of what was pushed since, and where in them
/// the latest record of every key stands.
pub struct Log {
    bytes: Vec<u8>,
    by_key: Index,
    by_value: Index,
    /// Everything before this offset is on disk.
    written: usize,
    /// Records that no run reads and that wait to be written.
    origins: Vec<u8>,
    /// Bytes of the log on disk that belong to no record.
    pub damaged: usize,
    /// Sizes of the contents in files, by checksum.
    contents: HashMap<Digest, u64, BuildHasherDefault<FirstBytes>>,
}

impl Log {
    pub fn read(root: &Path, warnings: &mut Vec<String>) -> Self {
        let path = path(root);
        let bytes = match fs::read(&path) {
            Ok(bytes) if bytes.is_empty() => {
                // Somebody may be writing its first bytes; whoever appends holds the lock. Who collects holds it too, and
                // reads the log himself: so this must not wait for long.
                let lock = File::open(lock_path(root)); // not made here: who only looks makes nothing
                for _ in 0..20 {
                    if lock.as_ref().map_or(true, |lock| lock.try_lock().is_ok()) {
                        break;
                    }
                    std::thread::sleep(std::time::Duration::from_millis(5));
                }
                let again = fs::read(&path).unwrap_or_default();
                if again.is_empty() && path.exists() {
                    let what = "is empty; what it recorded is computed again";
                    warnings.push(format!("the store's {} {what}", path.display()));
                }
                again
            }
            Ok(bytes) => bytes,
            Err(error) => {
                if error.kind() != io::ErrorKind::NotFound && error.kind() != io::ErrorKind::NotADirectory {
                    warnings.push(format!("the store's {} cannot be read ({error})", path.display()));
                }
                Vec::new()
            }
        };
        let mut log = Self::of(bytes);
        let damaged = log.damaged;
        if damaged > 0 {
            warnings.push(format!(
                "{damaged} bytes of the store's {} are damaged; what they recorded is computed again",
                path.display()
            ));
        }
        log.written = log.bytes.len();
        log
    }

    /// A log of these bytes, none of which are on disk.
    pub fn of(bytes: Vec<u8>) -> Self {
        // A record of no known kind is as foreign as bytes that do not verify.
        let kind = |frame: &std::ops::Range<usize>| bytes.get(frame.start).copied();
        let (mut frames, mut damaged) = frames(&bytes);
        frames.retain(|frame| {
            let known = matches!(kind(frame), Some(1..=3));
            damaged += if known { 0 } else { frame.len() + FRAME };
            known
        });
        let mut log = Self {
            written: 0,
            bytes,
            by_key: Index::default(),
            by_value: Index::default(),
            origins: Vec::new(),
            damaged,
            contents: HashMap::default(),
        };
        log.by_key.reserve(frames.len());
        for frame in frames {
            log.index(frame);
        }
        log
    }

    fn index(&mut self, frame: std::ops::Range<usize>) {
        // Only keys are read here: opening a log of 100,000 records must cost milliseconds.
        let payload = &self.bytes[frame.clone()];
        let digest = |at: usize| {
            payload
                .get(at..at + 32)
                .and_then(|bytes| bytes.first_chunk().copied().map(Digest))
        };
        let place = (frame.start, frame.end);
        if let Some(key) = digest(1) {
            self.by_key.insert(key, place);
        }
        let mut content_at = 33;
        if payload.first() == Some(&1) {
            content_at = 65;
            if let (Some(value), Some(1 | 2)) = (digest(33), payload.get(65)) {
                self.by_value.insert(value, place);
            }
        }
        if matches!(payload.first(), Some(1 | 3)) && payload.get(content_at) == Some(&2) {
            let size = payload
                .get(content_at + 33..content_at + 41)
                .and_then(|bytes| bytes.first_chunk());
            if let (Some(checksum), Some(bytes)) = (digest(content_at + 1), size) {
                self.contents.insert(checksum, u64::from_le_bytes(*bytes));
            }
        }
    }

    pub fn find(&self, key: &Digest) -> Option<Record> {
        let (start, end) = *self.by_key.get(key)?;
        Record::read(&self.bytes[start..end]).filter(|record| record.key() == key)
    }

    /// A record that says where the content of a value is.
    pub fn find_value(&self, value: &Digest) -> Option<Done> {
        let (start, end) = *self.by_value.get(value)?;
        match Record::read(&self.bytes[start..end])? {
            Record::Done(done) if done.value == *value => Some(done),
            _ => None,
        }
    }

    pub fn push(&mut self, record: &Record) {
        let start = self.bytes.len();
        record.write(&mut self.bytes);
        let frame = start + 8..self.bytes.len() - 8;
        self.index(frame);
    }

    pub fn push_origin(&mut self, origin: &Origin) {
        origin.write(&mut self.origins);
    }

    /// Bytes of the log.
    pub fn len(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Bytes of the log and of the contents that it mentions, some of which may have been removed.
    pub fn bytes(&self) -> u64 {
        self.len() + self.contents.values().sum::<u64>()
    }

    pub fn pending_bytes(&self) -> usize {
        self.bytes.len() - self.written + self.origins.len()
    }

    /// Appends what was pushed since the last call, with one write a log, for one who holds the folder's lock. Origins
    /// go first: a record whose origin is lost cannot be explained.
    pub fn append(&mut self, root: &Path) -> io::Result<u64> {
        let pending = self.pending_bytes();
        // Opened anew each time: `gc` of another process may have put a new file in its place.
        let append = |path: PathBuf, bytes: &[u8]| {
            let mut file = OpenOptions::new().append(true).create(true).open(path)?;
            file.write_all(bytes)
        };
        let origins = std::mem::take(&mut self.origins);
        let first = append(origins_path(root), &origins);
        let result = first.and_then(|()| append(path(root), &self.bytes[self.written..]));
        // Even a torn write is not repeated: its records verify or are skipped, and repeating costs a full disk more.
        self.written = self.bytes.len();
        result.map(|()| pending as u64)
    }

    /// All records in the order in which they were written; the latest of a key only.
    pub fn records(&self) -> Vec<Record> {
        let mut places: Vec<_> = self.by_key.values().copied().collect();
        places.sort_unstable();
        places
            .into_iter()
            .filter_map(|(start, end)| Record::read(&self.bytes[start..end]))
            .collect()
    }
}

/// The origins on disk, oldest first, and the bytes that belong to none.
pub fn read_origins(root: &Path) -> io::Result<(Vec<Origin>, usize)> {
    let bytes = match fs::read(origins_path(root)) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(error),
    };
    Ok(origins_of(&bytes))
}

/// The origins in the bytes of a log, and the bytes that belong to none.
pub fn origins_of(bytes: &[u8]) -> (Vec<Origin>, usize) {
    let (frames, mut damaged) = frames(bytes);
    let mut origins = Vec::with_capacity(frames.len());
    for frame in frames {
        let size = frame.len() + FRAME;
        match Origin::read(&bytes[frame]) {
            Some(origin) => origins.push(origin),
            None => damaged += size,
        }
    }
    (origins, damaged)
}

fn lock_path(root: &Path) -> PathBuf {
    root.join("lock")
}

pub fn lock_file(root: &Path) -> io::Result<File> {
    OpenOptions::new().create(true).append(true).open(lock_path(root))
}

/// The folder's lock, as those who append hold it; `None` while somebody holds it who writes the logs anew.
pub fn try_lock_shared(root: &Path) -> io::Result<Option<File>> {
    let lock = lock_file(root)?;
    held(lock.try_lock_shared(), lock)
}

/// The same, as those hold it who write the logs anew; `None` while anybody else holds it.
pub fn try_lock_exclusive(root: &Path) -> io::Result<Option<File>> {
    let lock = lock_file(root)?;
    held(lock.try_lock(), lock)
}

/// The folder's lock for who writes the logs anew or must see them at rest. Must not be waited for while a store's own
/// state is locked.
pub fn lock_exclusive(root: &Path) -> io::Result<File> {
    let lock = lock_file(root)?;
    lock.lock()?;
    Ok(lock)
}

fn held(locked: Result<(), TryLockError>, lock: File) -> io::Result<Option<File>> {
    match locked {
        Ok(()) => Ok(Some(lock)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// The content that a record mentions.
pub fn content(record: &Record) -> Option<&Content> {
    match record {
        Record::Done(done) => done.content.as_ref(),
        Record::Blob { content, .. } => Some(content),
        Record::Need(_) => None,
    }
}
