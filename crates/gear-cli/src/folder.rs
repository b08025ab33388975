//! The output folder: no half-written file ever stands there under its final name, and a file that is right already
//! is left alone.

use std::collections::BTreeSet;
use std::io;
use std::path::{Component, Path, PathBuf};

use gear_image::io::{WriteError, write_atomically};

use crate::bundle::File;
use crate::error::CliError;

/// The record of a run.
pub const RECORD: &str = "run.json";

/// A folder that could be written when it was looked at.
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Finds out whether the folder can be written, or made, without leaving anything behind.
    pub fn probe(path: &Path) -> Result<Self, CliError> {
        let refuse = |cause: String| CliError::OutFolder {
            folder: path.to_path_buf(),
            cause,
        };
        let absolute = std::path::absolute(path).map_err(|e| refuse(e.to_string()))?;
        // The nearest folder that is there already: everything below it can be made if it can be written.
        for (depth, place) in absolute.ancestors().enumerate() {
            match std::fs::metadata(place) {
                Ok(found) if !found.is_dir() => {
                    return Err(refuse(format!("{} is a file, not a folder", place.display())));
                }
                Ok(_) => {
                    tempfile::tempfile_in(place).map_err(|e| {
                        let which = if depth == 0 {
                            String::new()
                        } else {
                            format!("in {}: ", place.display())
                        };
                        refuse(format!("cannot be written: {which}{e}"))
                    })?;
                    return Ok(Self {
                        path: path.to_path_buf(),
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(refuse(format!("{}: {error}", place.display()))),
            }
        }
        Err(refuse("no part of this path exists".to_owned()))
    }

    /// The name that a file has below the folder, with `/`; `None` if it is elsewhere or not there.
    pub fn name_of(&self, file: &Path) -> Option<String> {
        let folder = self.path.canonicalize().ok()?;
        let file = file.canonicalize().ok()?;
        let parts = file.strip_prefix(folder).ok()?.components();
        let parts: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
        Some(parts.join("/"))
    }

    /// The files that earlier runs wrote here, by the record that the last of them left; names below the folder with
    /// `/`. Names that lead out of the folder are not believed.
    pub fn recorded(&self) -> BTreeSet<String> {
        let text = std::fs::read(self.path.join(RECORD)).unwrap_or_default();
        let record: serde_json::Value = serde_json::from_slice(&text).unwrap_or_default();
        let names = record["files"].as_array().into_iter().flatten();
        names
            .filter_map(|name| name.as_str())
            .filter(|name| stays_below(Path::new(name)))
            .map(str::to_owned)
            .collect()
    }

    /// The first of these names under which something stands that no earlier run wrote. What has the very bytes that
    /// would be written there is in nobody's way.
    pub fn stranger<'b>(
        &self,
        names: &BTreeSet<String>,
        recorded: &BTreeSet<String>,
        bytes: &dyn Fn(&str) -> Option<&'b [u8]>,
    ) -> Option<String> {
        let mut unknown = names.difference(recorded);
        let taken = unknown.find(|name| {
            let path = self.path.join(name);
            let same = || bytes(name).is_some_and(|bytes| holds(&path, bytes));
            path.symlink_metadata().is_ok() && !same()
        });
        taken.cloned()
    }

    /// The mistake of asking for results where this file stands.
    pub fn taken(&self, name: &str) -> CliError {
        CliError::Taken {
            file: self.path.join(name),
        }
    }

    /// Whether this file stands in the folder.
    pub fn has(&self, name: &str) -> bool {
        self.path.join(name).is_file()
    }

    /// The bytes of a file in the folder, if it is there.
    pub fn bytes(&self, name: &str) -> Option<Vec<u8>> {
        std::fs::read(self.path.join(name)).ok()
    }

    /// Takes back that names were announced of which nothing was written: the record is what it was before.
    pub fn withdraw(&self, before: Option<Vec<u8>>, announced: &BTreeSet<String>) {
        // What cannot be taken back stays announced, which costs nobody anything.
        let _ = match before {
            Some(bytes) => self.write(&File::new(RECORD, bytes)).is_ok(),
            None => self.remove([RECORD.to_owned()].iter()) > 0,
        };
        // Folders were made for files that never came.
        let folders = announced.iter().filter_map(|name| Path::new(name).parent());
        for folder in folders.filter(|folder| !folder.as_os_str().is_empty()) {
            let _ = std::fs::remove_dir(self.path.join(folder));
        }
    }

    /// Removes these files, and folders that are empty then; how many files are gone. Whatever cannot be removed stays.
    pub fn remove<'n>(&self, names: impl Iterator<Item = &'n String>) -> usize {
        let mut gone = 0;
        for name in names {
            let path = self.path.join(name);
            // A folder that was replaced by a link leads elsewhere.
            let folders = Path::new(name).ancestors().skip(1);
            let linked = |folder: &Path| self.path.join(folder).symlink_metadata().is_ok_and(|m| m.is_symlink());
            if folders.clone().filter(|f| !f.as_os_str().is_empty()).any(linked) {
                continue;
            }
            if path.symlink_metadata().is_ok_and(|found| found.is_file()) && std::fs::remove_file(&path).is_ok() {
                gone += 1;
                for folder in folders.filter(|f| !f.as_os_str().is_empty()) {
                    // Fails, as it should, where something else is left.
                    let _ = std::fs::remove_dir(self.path.join(folder));
                }
            }
        }
        gone
    }

    /// Writes a file below the folder; its path. A file that has these bytes already is left alone.
    pub fn write(&self, file: &File) -> Result<PathBuf, CliError> {
        let path = self.path.join(&file.name);
        let failed = |cause| CliError::Write {
            file: path.clone(),
            cause,
        };
        if holds(&path, &file.bytes) {
            return Ok(path);
        }
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(failed)?;
        }
        write_atomically(&path, &file.bytes).map_err(|error| match error {
            WriteError::Io { source, .. } => failed(source),
            other => failed(io::Error::other(other)),
        })?;
        Ok(path)
    }
}

fn stays_below(name: &Path) -> bool {
    name.components().count() > 0 && name.components().all(|part| matches!(part, Component::Normal(_)))
}

fn holds(path: &Path, bytes: &[u8]) -> bool {
    let same_length = std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() == bytes.len() as u64);
    same_length && std::fs::read(path).is_ok_and(|found| found == bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_leaves_nothing_behind() {
        let root = tempfile::tempdir().unwrap();
        Folder::probe(&root.path().join("a/b")).unwrap();
        Folder::probe(root.path()).unwrap();
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 0);
    }

    #[test]
    fn only_recorded_files_below_the_folder_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        std::fs::create_dir_all(out.join("views")).unwrap();
        for name in ["mine.txt", "out/a.png", "out/notes.txt", "out/views/b.png"] {
            std::fs::write(root.path().join(name), "x").unwrap();
        }
        let folder = Folder::probe(&out).unwrap();
        let record = r#"{"files": ["a.png", "views/b.png", "../mine.txt", "/etc/passwd", "", 7, "gone.png"]}"#;
        std::fs::write(out.join(RECORD), record).unwrap();
        let names = folder.recorded();
        assert_eq!(names.iter().collect::<Vec<_>>(), ["a.png", "gone.png", "views/b.png"]);
        assert_eq!(folder.remove(names.iter()), 2);
        assert!(!out.join("views").exists() && out.join("notes.txt").exists());
        assert!(root.path().join("mine.txt").exists());
        std::fs::write(out.join(RECORD), "no JSON").unwrap();
        assert!(folder.recorded().is_empty());
    }

    #[test]
    fn a_file_that_no_run_wrote_is_in_the_way_unless_it_is_the_same() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::probe(root.path()).unwrap();
        std::fs::write(root.path().join("mine.png"), "mine").unwrap();
        std::fs::write(root.path().join("same.png"), "same").unwrap();
        let set = |names: &[&str]| names.iter().map(ToString::to_string).collect::<BTreeSet<_>>();
        let bytes = |name: &str| (name == "same.png").then_some(&b"same"[..]);
        let stranger = |names: &[&str], recorded: &[&str]| folder.stranger(&set(names), &set(recorded), &bytes);
        assert_eq!(stranger(&["mine.png", "new.png"], &[]).as_deref(), Some("mine.png"));
        assert_eq!(stranger(&["mine.png", "new.png"], &["mine.png"]), None);
        assert_eq!(stranger(&["new.png", "same.png"], &[]), None);
    }

    #[test]
    fn a_file_in_the_place_of_a_folder_is_refused() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        std::fs::write(&file, "x").unwrap();
        for path in [file.clone(), file.join("below")] {
            let message = Folder::probe(&path).err().unwrap().to_string();
            assert!(message.contains("--out"), "{message}");
        }
    }

    #[test]
    fn a_file_that_is_right_is_left_alone() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::probe(root.path()).unwrap();
        let file = File::new("views/a.txt", b"right".to_vec());
        let path = folder.write(&file).unwrap();
        let before = std::fs::metadata(&path).unwrap().modified().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
        folder.write(&file).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().modified().unwrap(), before);
        std::fs::write(&path, "wrong").unwrap();
        folder.write(&file).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"right");
        assert_eq!(
            std::fs::read_dir(root.path().join("views")).unwrap().count(),
            1,
            "nothing temporary is left"
        );
    }
}
