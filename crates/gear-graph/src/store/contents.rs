//! Contents: files named by the checksum of their bytes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::record::Content;
use crate::Digest;

pub struct Contents {
    root: PathBuf,
}

/// Makes the folders, and finds out whether they can be written.
pub fn prepare(root: &Path) -> io::Result<()> {
    fs::create_dir_all(root.join("contents"))?;
    fs::create_dir_all(root.join("tmp"))?;
    let tag = root.join("CACHEDIR.TAG");
    if !tag.exists() {
        // Backup programs leave out folders with this file (bford.info/cachedir).
        fs::write(
            tag,
            "Signature: 8a477f597d28d172789f06886806bc55\n# Made by gear; may be deleted at any time.\n",
        )?;
    }
    tempfile::tempfile_in(root.join("tmp"))?;
    super::log::lock_file(root).map(drop)
}

impl Contents {
    pub fn new(root: &Path) -> Self {
        Self {
            root: root.to_path_buf(),
        }
    }

    pub fn path(&self, checksum: &Digest, extension: &str) -> PathBuf {
        let hex = checksum.hex();
        // An extension comes from a record, which another program may have written.
        let extension: String = extension.chars().filter(char::is_ascii_alphanumeric).collect();
        self.root
            .join("contents")
            .join(&hex[..2])
            .join(format!("{hex}.{extension}"))
    }

    pub fn exists(&self, content: &Content) -> bool {
        match content {
            Content::Inline(_) => true,
            Content::File {
                checksum,
                bytes,
                extension,
            } => fs::metadata(self.path(checksum, extension)).is_ok_and(|meta| meta.len() == *bytes),
        }
    }

    /// Writes bytes under their checksum; whether a file was written that was not there before.
    pub fn write(&self, bytes: &[u8], extension: &str) -> io::Result<(Content, bool)> {
        let content = Content::File {
            checksum: Digest::of(bytes),
            bytes: bytes.len() as u64,
            extension: extension.to_string(),
        };
        let Content::File { checksum, .. } = &content else {
            return Ok((content, false));
        };
        let path = self.path(checksum, extension);
        if self.exists(&content) {
            return Ok((content, false));
        }
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let mut file = tempfile::Builder::new()
            .prefix("content-")
            .tempfile_in(self.root.join("tmp"))?;
        file.write_all(bytes)?;
        // Not synced: after a loss of power the checksum tells what did not reach the disk.
        file.persist(&path).map_err(|error| error.error)?;
        Ok((content, true))
    }

    /// The bytes, verified; `Ok(None)` if they are not there (any more), `Err` with what is wrong with them.
    pub fn read(&self, content: &Content) -> Result<Option<Vec<u8>>, String> {
        let (checksum, extension) = match content {
            Content::Inline(bytes) => return Ok(Some(bytes.clone())),
            Content::File {
                checksum, extension, ..
            } => (checksum, extension),
        };
        let path = self.path(checksum, extension);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(format!("cannot be read ({error})")),
        };
        if Digest::of(&bytes) != *checksum {
            return Err("does not have the checksum that is its name".to_string());
        }
        // Its age decides what `gc` removes. A store that cannot be written does without.
        if let Ok(file) = File::open(&path) {
            let _ = file.set_modified(SystemTime::now());
        }
        Ok(Some(bytes))
    }

    /// Removes a content, if possible; its path.
    pub fn remove(&self, content: &Content) -> PathBuf {
        match content {
            Content::Inline(_) => self.root.clone(),
            Content::File {
                checksum, extension, ..
            } => {
                let path = self.path(checksum, extension);
                let _ = fs::remove_file(&path);
                path
            }
        }
    }
}
