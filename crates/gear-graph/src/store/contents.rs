//! Contents: files named by the checksum of their bytes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::log;
use super::record::Content;
use crate::Digest;

pub struct Contents {
    root: PathBuf,
    /// Whether reading a content counts as a use of it.
    marks_use: bool,
}

/// A file that gets its name when it is complete. Whoever may read the folder may read it then: the umask decides, as
/// for any other file, and a store serves all users whom its folder is open to.
pub fn new_file(prefix: &str, folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Backup programs leave out folders with a file that begins so (bford.info/cachedir).
const TAG: &str = "Signature: 8a477f597d28d172789f06886806bc55\n# Made by gear; may be deleted at any time.\n";

/// How the tag is named until it is complete.
const TAG_PREFIX: &str = ".tag-";

/// Whether a folder is a store.
pub fn is_store(root: &Path) -> bool {
    fs::read(root.join("CACHEDIR.TAG")).is_ok_and(|tag| tag == TAG.as_bytes())
}

/// Something in a folder that is not of a store that is being made; none if it is a store, is empty or is not there.
pub fn foreign(root: &Path) -> Option<String> {
    // What a system puts into an empty folder by itself, and what `prepare` writes before its tag.
    let ours = |name: &str| name.starts_with(TAG_PREFIX) || [".DS_Store", "lost+found"].contains(&name);
    let names = fs::read_dir(root).into_iter().flatten().flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let found = names.filter(|name| !ours(name)).min()?;
    // Asked last: another process may have made the store meanwhile.
    (!is_store(root)).then_some(found)
}

/// Makes the folders, and finds out whether they can be written.
pub fn prepare(root: &Path) -> io::Result<()> {
    // Collecting garbage in somebody's folder of that name would be a disaster. The tag is written first: whoever sees
    // folders of a store that is being made sees its tag too.
    if !is_store(root) {
        if root.is_file() {
            return Err(io::Error::other("it is a file, not a folder"));
        }
        for name in ["contents", "tmp"] {
            if root.join(name).exists() && !is_store(root) {
                return Err(io::Error::other(format!(
                    "it is no store, and has a `{name}` of its own"
                )));
            }
        }
        fs::create_dir_all(root)?;
        let mut tag = new_file(TAG_PREFIX, root)?;
        tag.write_all(TAG.as_bytes())?;
        tag.persist(root.join("CACHEDIR.TAG")).map_err(|error| error.error)?;
    }
    fs::create_dir_all(root.join("contents"))?;
    fs::create_dir_all(root.join("tmp"))?;
    tempfile::tempfile_in(root.join("tmp"))?;
    log::lock_file(root).map(drop)
}

impl Contents {
    pub fn new(root: &Path, marks_use: bool) -> Self {
        Self {
            root: root.to_path_buf(),
            marks_use,
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

    /// The checksum that a content's path promises; `None` if it is no path of a content.
    pub fn named(path: &Path) -> Option<Digest> {
        let (hex, extension) = path.file_name()?.to_str()?.split_once('.')?;
        let folder = path.parent()?.file_name()?.to_str()?;
        let plain = extension.chars().all(|c| c.is_ascii_alphanumeric());
        (plain && hex.get(..2) == Some(folder)).then(|| Digest::from_hex(hex))?
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
        let mut file = new_file("content-", &self.root.join("tmp"))?;
        file.write_all(bytes)?;
        // Not synced: after a loss of power the checksum tells what did not reach the disk.
        file.persist(&path).map_err(|error| error.error)?;
        Ok((content, true))
    }

    /// The bytes, verified; `Ok(None)` if they are not there (any more), `Err` with what is wrong with them.
    pub fn read(&self, content: &Content) -> Result<Option<Vec<u8>>, String> {
        let read = self.look_at(content);
        // Its age decides what `gc` removes. A store that cannot be written does without.
        if let (
            Ok(Some(_)),
            Content::File {
                checksum, extension, ..
            },
        ) = (&read, content)
            && self.marks_use
            && let Ok(file) = File::open(self.path(checksum, extension))
        {
            let _ = file.set_modified(SystemTime::now());
        }
        read
    }

    /// The same, without counting as a use.
    pub fn look_at(&self, content: &Content) -> Result<Option<Vec<u8>>, String> {
        let (checksum, extension) = match content {
            Content::Inline(bytes) => return Ok(Some(bytes.clone())),
            Content::File {
                checksum, extension, ..
            } => (checksum, extension),
        };
        match fs::read(self.path(checksum, extension)) {
            Ok(bytes) if Digest::of(&bytes) == *checksum => Ok(Some(bytes)),
            Ok(_) => Err("does not have the checksum that is its name".to_string()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(format!("cannot be read ({error})")),
        }
    }

    /// Where a content is.
    pub fn place(&self, content: &Content) -> PathBuf {
        match content {
            Content::Inline(_) => log::path(&self.root),
            Content::File {
                checksum, extension, ..
            } => self.path(checksum, extension),
        }
    }

    /// Removes a content that is a file, if possible; its path.
    pub fn remove(&self, content: &Content) -> PathBuf {
        let path = self.place(content);
        if let Content::File { .. } = content {
            let _ = fs::remove_file(&path);
        }
        path
    }
}
