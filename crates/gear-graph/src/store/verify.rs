//! Reading everything that a store holds, and telling what is wrong with it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::panic::catch_unwind;

use super::contents::Contents;
use super::gc::files;
use super::record::{Content, Done, Record};
use super::{Store, log};
use crate::{Digest, ValueType};

/// What [`Store::verify`] found.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Verified {
    /// Records that verified.
    pub records: usize,
    /// Contents that have the checksum that is their name.
    pub contents: usize,
    /// Their bytes.
    pub bytes: u64,
    /// Values that were decoded and have the digest that their record promises.
    pub values: usize,
    /// Values of types that are not known here, of which the bytes alone were verified.
    pub unknown_types: BTreeMap<String, usize>,
    /// Files in the folder that the store did not put there. They are left alone.
    pub foreign: Vec<String>,
    /// What is wrong.
    pub problems: Vec<String>,
    /// How many contents and records were removed.
    pub removed: usize,
}

impl Store {
    /// Reads every record and every content, and checks checksums and digests. Values of types that `types` does not
    /// know are not decoded. With `repair`, what is wrong is removed, so that it is computed again.
    pub fn verify(&self, types: &dyn Fn(&str) -> Option<ValueType>, repair: bool) -> io::Result<Verified> {
        self.flush();
        // Who appends holds the lock: without it a batch that is being written would look torn. A store that cannot
        // be written has nobody who appends.
        let folder = log::lock_exclusive(&self.root).ok();
        let log = log::Log::of(match fs::read(log::path(&self.root)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            read => read?,
        });
        let (origins, damaged_origins) = log::read_origins(&self.root)?;
        if !repair {
            drop(folder);
        }
        let mut found = Verified::default();
        for (name, damaged) in [(log::ACTIONS, log.damaged), (log::ORIGINS, damaged_origins)] {
            if damaged > 0 {
                found.problems.push(format!("{name}: {damaged} bytes are no records"));
            }
        }
        let records = log.records();
        found.records = records.len() + origins.len();
        let bad_contents = self.verify_contents(&mut found);
        let bad_records = self.verify_values(&records, &bad_contents, types, &mut found);
        if repair && !found.problems.is_empty() {
            for path in &bad_contents {
                fs::remove_file(path)?;
            }
            found.removed = bad_contents.len() + bad_records.len();
            let good = records.into_iter().filter(|record| !bad_records.contains(record.key()));
            self.rewrite(good.collect(), u64::MAX)?;
            self.rewrite_origins(u64::MAX)?;
        }
        Ok(found)
    }

    /// The files whose bytes are not what their names say.
    fn verify_contents(&self, found: &mut Verified) -> BTreeSet<std::path::PathBuf> {
        let mut bad = BTreeSet::new();
        for (path, _) in files(&self.root.join("contents")) {
            let name = path.strip_prefix(&self.root).unwrap_or(&path).display().to_string();
            let Some(checksum) = Contents::named(&path) else {
                found.foreign.push(name);
                continue;
            };
            let problem = match fs::read(&path) {
                Ok(bytes) if Digest::of(&bytes) == checksum => {
                    found.contents += 1;
                    found.bytes += bytes.len() as u64;
                    continue;
                }
                // Collected by somebody a moment ago.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Ok(bytes) => format!("its {} bytes do not have the checksum that is its name", bytes.len()),
                Err(error) => format!("cannot be read ({error})"),
            };
            found.problems.push(format!("{name}: {problem}"));
            bad.insert(path);
        }
        bad
    }

    /// The keys of the records whose content is another value than they promise.
    fn verify_values(
        &self,
        records: &[Record],
        bad_contents: &BTreeSet<std::path::PathBuf>,
        types: &dyn Fn(&str) -> Option<ValueType>,
        found: &mut Verified,
    ) -> BTreeSet<Digest> {
        let mut bad = BTreeSet::new();
        // Many actions may have given one value.
        let mut known: BTreeMap<(Digest, Digest), bool> = BTreeMap::new();
        for record in records {
            let Record::Done(done) = record else { continue };
            let Some(content) = &done.content else { continue };
            let (checksum, place) = match content {
                Content::Inline(bytes) => (Digest::of(bytes), log::ACTIONS.to_string()),
                Content::File {
                    checksum, extension, ..
                } => {
                    let path = self.contents.path(checksum, extension);
                    if bad_contents.contains(&path) || !path.exists() {
                        continue; // told already, or collected
                    }
                    (
                        *checksum,
                        path.strip_prefix(&self.root).unwrap_or(&path).display().to_string(),
                    )
                }
            };
            let Some(value_type) = types(&done.type_name) else {
                *found.unknown_types.entry(done.type_name.clone()).or_default() += 1;
                continue;
            };
            let good = *known.entry((done.value, checksum)).or_insert_with(|| {
                let verdict = self.verdict(done, content, &value_type);
                match &verdict {
                    Ok(()) => found.values += 1,
                    Err(problem) => found.problems.push(format!("{place}: `{}` {problem}", done.label)),
                }
                verdict.is_ok()
            });
            if !good {
                bad.insert(done.key);
            }
        }
        bad
    }

    fn verdict(&self, done: &Done, content: &Content, value_type: &ValueType) -> Result<(), String> {
        let Some(bytes) = self.contents.look_at(content)? else {
            return Ok(()); // collected a moment ago
        };
        match catch_unwind(|| value_type.decode(&bytes)) {
            Ok(Ok(value)) if value.digest() == done.value => Ok(()),
            Ok(Ok(_)) => Err(format!("holds another {} than its record promises", value_type.name)),
            Ok(Err(error)) => Err(format!("cannot be decoded ({error})")),
            Err(_) => Err("made the decoder panic".to_string()),
        }
    }
}
