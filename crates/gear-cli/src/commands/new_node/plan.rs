//! Writing a plan: all of it, or nothing.

use std::io;
use std::path::{Path, PathBuf};

use gear_image::io::write_atomically;

use super::Refusal;

/// Everything that is to be written.
pub struct Plan {
    /// The folder of the crate; it must not be there yet.
    pub folder: PathBuf,
    /// Its name for people.
    pub shown: String,
    /// The files in it.
    pub files: Vec<(String, String)>,
    /// Files that are there already.
    pub edits: Vec<Edit>,
    /// What to do next.
    pub notes: Vec<String>,
}

/// A change of a file.
pub struct Edit {
    path: PathBuf,
    name: &'static str,
    /// What it does, for people.
    done: &'static str,
    before: String,
    after: String,
}

impl Edit {
    pub fn new(root: &Path, name: &'static str, done: &'static str, before: String, after: String) -> Self {
        Self {
            path: root.join(name),
            name,
            done,
            before,
            after,
        }
    }
}

impl Plan {
    /// Writes it; what was done, for people.
    pub fn write(self) -> Result<String, Refusal> {
        if self.folder.symlink_metadata().is_ok() {
            return Err(Refusal::new(format!(
                "the folder {} exists already; take another name, or remove it",
                self.shown
            )));
        }
        self.crate_folder()
            .map_err(|e| Refusal::new(format!("{} cannot be written: {e}", self.shown)))?;
        for (i, edit) in self.edits.iter().enumerate() {
            if let Err(error) = write_atomically(&edit.path, edit.after.as_bytes()) {
                self.take_back(i);
                return Err(Refusal::new(format!("{} cannot be written: {error}", edit.name)));
            }
        }
        let mut lines: Vec<_> = self
            .files
            .iter()
            .map(|(name, _)| format!("{}/{name}", self.shown))
            .collect();
        lines.extend(self.edits.iter().map(|edit| format!("{}: {}", edit.name, edit.done)));
        lines.extend(self.notes);
        Ok(lines.join("\n"))
    }

    /// Writes the crate under another name, and gives it its own when it is whole.
    fn crate_folder(&self) -> io::Result<()> {
        let parent = self.folder.parent().unwrap_or(Path::new("."));
        let workshop = tempfile::Builder::new().prefix(".new-node-").tempdir_in(parent)?;
        // Below the temporary folder: `nodes/*` are members of the workspace, `nodes/*/*` are not.
        let folder = workshop.path().join("crate");
        for (name, text) in &self.files {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(&folder))?;
            std::fs::write(path, text)?;
        }
        std::fs::rename(&folder, &self.folder)
    }

    /// Undoes the first `count` edits and the crate.
    fn take_back(&self, count: usize) {
        // What cannot be undone either is a broken disk, of which the error that follows tells.
        for edit in &self.edits[..count] {
            let _ = write_atomically(&edit.path, edit.before.as_bytes());
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
