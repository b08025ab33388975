//! A store, or a part of it, as one file: a tar archive, for machines that begin with an empty store.
//!
//! ```text
//! gear-store.json        the archive's format, and how many records and contents follow
//! actions-1.log          records, framed as in the store
//! origins-1.log          where they came from
//! contents/ab/ab12….exr  contents, by name
//! ```
//!
//! The archive of a store depends on what the store holds and on nothing else: entries are sorted and have no time and
//! no owner. Whatever is read from an archive is verified before anything of it is kept: an archive that is cut off,
//! damaged or of something else changes nothing.

use std::collections::{BTreeSet, HashMap};
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::contents::{Contents, new_file};
use super::record::{Content, Record};
use super::{Store, log};
use crate::{Digest, Run, RunMistake};

const MANIFEST: &str = "gear-store.json";
const FORMAT: u32 = 1;

/// What an archive says of itself.
#[derive(Deserialize, Serialize)]
struct Manifest {
    format: u32,
    records: usize,
    contents: usize,
}

/// What was put into an archive, or taken from one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Archived {
    /// Records in the archive.
    pub records: usize,
    /// Contents in the archive.
    pub contents: usize,
    /// Bytes of the contents.
    pub bytes: u64,
    /// Of an import: records and contents that the store did not have.
    pub new: usize,
    /// Of an export: values and artefacts whose bytes are not in the store any more, collected or damaged. Their
    /// digests travel, they do not.
    pub lost: usize,
}

/// Why an archive was not written or not taken.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArchiveError {
    /// A file cannot be read or written.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// The file is something else.
    #[error("{}: this is no archive of a store ({found}); expected a file that `gear cache export` wrote", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What was found.
        found: String,
    },
    /// The archive was written by a newer version.
    #[error("{}: the archive has format {found}, this version reads format {FORMAT}; update gear, or export again", path.display())]
    TooNew {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u32,
    },
    /// The archive is damaged.
    #[error("{}: the archive is damaged ({problem}); nothing was imported; export it again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// There is nothing to write; an archive that was there is as it was.
    #[error("the store {} holds nothing of what was asked for; nothing was written", path.display())]
    Nothing {
        /// The folder of the store.
        path: PathBuf,
    },
    /// The store cannot be written.
    #[error("the store {} cannot be written{}", path.display(), problem.as_ref().map(|p| format!(" ({p})")).unwrap_or_default())]
    ReadOnly {
        /// Its folder.
        path: PathBuf,
        /// Why.
        problem: Option<String>,
    },
}

impl Store {
    /// Writes everything that the store holds into an archive.
    pub fn export(&self, to: &Path) -> Result<Archived, ArchiveError> {
        self.flush();
        let records = log::Log::read(&self.root, &mut Vec::new()).records();
        self.write_archive(to, records)
    }

    /// Writes into an archive what a run needs to find everything stored: the records that it would look up, and the
    /// values that they hold. Also says how many nodes the run would still have to compute.
    ///
    /// # Errors
    /// The outer error is the user's mistake in what was asked for; nothing is written then.
    pub fn export_run(
        &self,
        to: &Path,
        run: &Run<'_>,
    ) -> Result<Result<(Archived, usize), ArchiveError>, Vec<RunMistake>> {
        self.listen();
        let plan = run.plan()?;
        let heard: BTreeSet<Digest> = self.heard().into_iter().collect();
        let missing = plan.nodes.iter().filter(|node| node.state == crate::PlannedState::Runs);
        let missing = missing.count();
        let all = log::Log::read(&self.root, &mut Vec::new()).records();
        let records = all.into_iter().filter(|record| heard.contains(record.key()));
        Ok(self
            .write_archive(to, records.collect())
            .map(|archived| (archived, missing)))
    }

    fn write_archive(&self, to: &Path, records: Vec<Record>) -> Result<Archived, ArchiveError> {
        let io = |cause: io::Error| ArchiveError::Io {
            path: to.to_path_buf(),
            cause,
        };
        may_become_an_archive(to).map_err(io)?;
        if records.is_empty() {
            return Err(ArchiveError::Nothing {
                path: self.root.clone(),
            });
        }
        let mut contents = BTreeSet::new();
        let mut actions = Vec::new();
        let mut keys = BTreeSet::new();
        let mut lost = 0;
        for mut record in records {
            // A content that is gone or damaged does not travel; what its record says of the digest is good.
            let sound = |content: &Content| matches!(self.contents.look_at(content), Ok(Some(_)));
            match &mut record {
                Record::Done(done) if !done.content.as_ref().is_some_and(sound) => {
                    done.content = None;
                    lost += 1;
                }
                Record::Blob { content, .. } if !sound(content) => {
                    lost += 1;
                    continue;
                }
                _ => {}
            }
            if let Some(Content::File {
                checksum, extension, ..
            }) = log::content(&record)
            {
                contents.insert(self.contents.path(checksum, extension));
            }
            keys.insert(*record.key());
            record.write(&mut actions);
        }
        let mut origins = Vec::new();
        for origin in self.origins().iter().filter(|origin| keys.contains(&origin.key)) {
            origin.write(&mut origins);
        }
        let manifest = Manifest {
            format: FORMAT,
            records: keys.len(),
            contents: contents.len(),
        };
        let folder = to
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let file = new_file(".gear-export-", folder).map_err(io)?;
        let mut archive = tar::Builder::new(BufWriter::new(file));
        let mut add = |name: &Path, bytes: &[u8]| {
            let mut header = tar::Header::new_gnu();
            header.set_size(bytes.len() as u64);
            header.set_mode(0o644);
            archive.append_data(&mut header, name, bytes)
        };
        let text = serde_json::to_vec(&manifest).map_err(|error| io(error.into()))?;
        add(Path::new(MANIFEST), &text).map_err(io)?;
        add(Path::new(log::ACTIONS), &actions).map_err(io)?;
        add(Path::new(log::ORIGINS), &origins).map_err(io)?;
        let mut bytes = 0;
        for path in &contents {
            let content = fs::read(path).map_err(|cause| ArchiveError::Io {
                path: path.clone(),
                cause,
            })?;
            bytes += content.len() as u64;
            add(path.strip_prefix(&self.root).unwrap_or(path), &content).map_err(io)?;
        }
        let written = archive
            .into_inner()
            .and_then(|file| Ok(file.into_inner()?))
            .map_err(io)?;
        written.persist(to).map_err(|error| io(error.error))?;
        Ok(Archived {
            records: keys.len(),
            contents: contents.len(),
            bytes,
            new: 0,
            lost,
        })
    }

    /// Reads an archive and verifies all of it; nothing is written.
    pub fn check_archive(from: &Path) -> Result<Archived, ArchiveError> {
        Ok(Staged::read(from, None)?.archived())
    }

    /// Adds what an archive holds. All of it is verified before any of it is kept.
    pub fn import(&self, from: &Path) -> Result<Archived, ArchiveError> {
        let cannot_write = |problem: Option<String>| ArchiveError::ReadOnly {
            path: self.root.clone(),
            problem,
        };
        if self.inner().read_only {
            return Err(cannot_write(self.warnings().pop()));
        }
        let stage = tempfile::Builder::new()
            .prefix("import-")
            .tempdir_in(self.root.join("tmp"))
            .map_err(|error| cannot_write(Some(error.to_string())))?;
        let staged = Staged::read(from, Some(stage.path()))?;
        let mut archived = staged.archived();
        for (path, (at, bytes)) in &staged.contents {
            let to = self.root.join(path);
            if fs::metadata(&to).is_ok_and(|meta| meta.len() == *bytes) {
                continue;
            }
            archived.new += 1;
            let moved = fs::create_dir_all(to.parent().unwrap_or(&self.root)).and_then(|()| fs::rename(at, &to));
            moved.map_err(|error| cannot_write(Some(error.to_string())))?;
        }
        let mut keys = BTreeSet::new();
        let mut inner = self.inner();
        for record in &staged.records {
            let known = inner.log.find(record.key());
            let better = |ours: &Record| match (log::content(ours), log::content(record)) {
                (Some(content), _) => self.contents.exists(content),
                (None, theirs) => theirs.is_none(),
            };
            if !known.as_ref().is_some_and(better) {
                inner.log.push(record);
                keys.insert(*record.key());
            }
        }
        archived.new += keys.len();
        for origin in staged.origins.iter().filter(|origin| keys.contains(&origin.key)) {
            inner.log.push_origin(origin);
        }
        drop(inner);
        self.flush();
        match self.inner().read_only {
            true => Err(cannot_write(self.warnings().pop())),
            false => Ok(archived),
        }
    }
}

/// Whether an archive may be written there: nothing is replaced but an archive.
fn may_become_an_archive(path: &Path) -> io::Result<()> {
    let refuse = |cause: &str| Err(io::Error::other(cause));
    if path == Path::new("-") {
        return refuse("an archive is not written to standard output; name a file");
    }
    let found = match fs::metadata(path) {
        Ok(found) => found,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    if !found.is_file() {
        return refuse("this is no regular file; name a new file, or an archive to replace");
    }
    let mut head = vec![0; MANIFEST.len()];
    let archive = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    if archive.is_ok() && head == MANIFEST.as_bytes() {
        return Ok(());
    }
    refuse("there is a file already, and it is no archive of a store; name a new file, or an archive to replace")
}

/// What was read from an archive: verified, and not yet part of the store.
struct Staged {
    records: Vec<Record>,
    origins: Vec<super::Origin>,
    /// Where every content belongs in the store, where it is now, and its size.
    contents: HashMap<PathBuf, (PathBuf, u64)>,
}

impl Staged {
    fn archived(&self) -> Archived {
        Archived {
            records: self.records.len(),
            contents: self.contents.len(),
            bytes: self.contents.values().map(|(_, bytes)| bytes).sum(),
            ..Archived::default()
        }
    }

    /// Reads and verifies an archive; its contents go to files in `stage`, or nowhere.
    fn read(from: &Path, stage: Option<&Path>) -> Result<Self, ArchiveError> {
        let path = || from.to_path_buf();
        let io = |cause: io::Error| ArchiveError::Io { path: path(), cause };
        let foreign = |found: &str| ArchiveError::Foreign {
            path: path(),
            found: found.to_string(),
        };
        let damaged = |problem: String| ArchiveError::Damaged { path: path(), problem };
        if fs::metadata(from).map_err(io)?.is_dir() {
            return Err(foreign("it is a folder"));
        }
        let file = File::open(from).map_err(io)?;
        let mut archive = tar::Archive::new(BufReader::new(file));
        let mut entries = archive.entries().map_err(io)?;
        // Whatever is wrong with the first entry, the file is no archive of ours.
        let manifest = entries.next().and_then(Result::ok).and_then(|mut entry| {
            let name = entry.path().ok()?.into_owned();
            let mut text = String::new();
            let small = name == Path::new(MANIFEST) && entry.size() < 4096;
            small.then(|| entry.read_to_string(&mut text).ok())??;
            serde_json::from_str::<Manifest>(&text).ok()
        });
        let Some(manifest) = manifest else {
            return Err(foreign(&format!("it does not begin with {MANIFEST}")));
        };
        if manifest.format > FORMAT {
            return Err(ArchiveError::TooNew {
                path: path(),
                found: manifest.format,
            });
        }
        let mut staged = Self {
            records: Vec::new(),
            origins: Vec::new(),
            contents: HashMap::new(),
        };
        for entry in entries {
            let mut entry = entry.map_err(|error| damaged(error.to_string()))?;
            let name = entry.path().map_err(|error| damaged(error.to_string()))?.into_owned();
            if name == Path::new(log::ACTIONS) || name == Path::new(log::ORIGINS) {
                let mut bytes = Vec::new();
                entry
                    .read_to_end(&mut bytes)
                    .map_err(|error| damaged(error.to_string()))?;
                let bad = if name == Path::new(log::ACTIONS) {
                    let log = log::Log::of(bytes);
                    staged.records = log.records();
                    log.damaged
                } else {
                    let (origins, bad) = log::origins_of(&bytes);
                    staged.origins = origins;
                    bad
                };
                if bad > 0 {
                    return Err(damaged(format!("{bad} bytes of {} are no records", name.display())));
                }
                continue;
            }
            let promised = Some(&name)
                .filter(|name| name.parent().and_then(Path::parent) == Some(Path::new("contents")))
                .and_then(|name| Contents::named(name));
            let Some(promised) = promised else {
                return Err(damaged(format!(
                    "it holds `{}`, which is no part of a store",
                    name.display()
                )));
            };
            let at = stage.map_or(PathBuf::new(), |stage| stage.join(staged.contents.len().to_string()));
            let mut out: Box<dyn Write> = match stage {
                None => Box::new(io::sink()),
                Some(_) => Box::new(File::create(&at).map_err(|cause| ArchiveError::Io {
                    path: at.clone(),
                    cause,
                })?),
            };
            let (digest, bytes) = copy(&mut entry, out.as_mut()).map_err(|error| damaged(error.to_string()))?;
            if digest != promised {
                return Err(damaged(format!(
                    "{} does not have the checksum that is its name",
                    name.display()
                )));
            }
            staged.contents.insert(name, (at, bytes));
        }
        let found = (staged.records.len(), staged.contents.len());
        if found != (manifest.records, manifest.contents) {
            return Err(damaged(format!(
                "it holds {} records and {} contents, and should hold {} and {}",
                found.0, found.1, manifest.records, manifest.contents
            )));
        }
        Ok(staged)
    }
}

/// Copies, and takes the checksum on the way.
fn copy(from: &mut impl Read, to: &mut dyn Write) -> io::Result<(Digest, u64)> {
    let mut hasher = blake3::Hasher::new();
    let mut piece = vec![0; 1 << 18];
    let mut total = 0;
    loop {
        let read = from.read(&mut piece)?;
        if read == 0 {
            return Ok((Digest(*hasher.finalize().as_bytes()), total));
        }
        hasher.update(&piece[..read]);
        to.write_all(&piece[..read])?;
        total += read as u64;
    }
}
