//! The output folder: no half-written file ever stands there under its final name, and a file that is right already
//! is left alone.

use std::io;
use std::path::{Path, PathBuf};

use gear_image::io::{WriteError, write_atomically};

use crate::bundle::File;
use crate::error::CliError;

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
