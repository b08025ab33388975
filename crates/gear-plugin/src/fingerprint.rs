//! What a plugin's results depend on, as far as its folder tells: the declared sources, the lock file, the command and
//! the variables that it sets. Never a virtual environment, a compiled cache or weights: those are large, differ between
//! machines, and are told by the worker itself in its handshake, as versions and digests.

use std::path::{Path, PathBuf};

use gear_graph::{Digest, Hasher};

use crate::{FILE_NAME, Manifest, PluginError};

/// Folders that hold what is installed or made, never what was written.
const NO_SOURCES: &[&str] = &["__pycache__", "node_modules", "target", "venv"];

/// Endings of weights and of compiled files.
const NO_SOURCE_ENDINGS: &[&str] = &[
    "bin",
    "ckpt",
    "engine",
    "gguf",
    "h5",
    "npz",
    "onnx",
    "pkl",
    "pt",
    "pth",
    "pyc",
    "pyo",
    "safetensors",
];

/// A source larger than this is data.
const MOST_BYTES: u64 = 16 << 20;

/// More sources than this are no sources.
const MOST_FILES: usize = 10_000;

/// The digest of all that is declared.
///
/// # Errors
/// If a declared file is not there, or the sources are larger than sources are.
pub fn fingerprint(folder: &Path, manifest: &Manifest) -> Result<Digest, PluginError> {
    let mut hasher = Hasher::new("plugin");
    hasher.u64(crate::PROTOCOL).bytes(manifest.name.as_bytes());
    for part in &manifest.command {
        hasher.bytes(part.as_bytes());
    }
    hasher.bytes(b"environment");
    for (name, value) in &manifest.environment.set {
        hasher.bytes(name.as_bytes()).bytes(value.as_bytes());
    }
    let mut files = Vec::new();
    for source in &manifest.sources {
        collect(&folder.join(source), source, true, &mut files)?;
    }
    // Of plugin.yaml that counts which is hashed above: whoever raises a time limit computes nothing again.
    let described = manifest.nodes.as_ref().map(|nodes| folder.join(nodes));
    files.retain(|(_, path)| *path != folder.join(FILE_NAME) && Some(path) != described.as_ref());
    files.sort();
    files.dedup();
    for (name, path) in files {
        // The same on every system.
        let name = name.to_string_lossy().replace('\\', "/");
        hasher.bytes(name.as_bytes()).digest(&digest(&path)?);
    }
    if let Some(lock) = &manifest.lock {
        hasher.bytes(b"lock").digest(&digest(&folder.join(lock))?);
    }
    Ok(hasher.finish())
}

fn error(path: &Path, cause: impl ToString) -> PluginError {
    PluginError::Source {
        path: path.to_path_buf(),
        cause: cause.to_string(),
    }
}

fn digest(path: &Path) -> Result<Digest, PluginError> {
    let size = std::fs::metadata(path).map_err(|cause| error(path, cause))?.len();
    if size > MOST_BYTES {
        return Err(error(
            path,
            format!("is {size} bytes long; a source has at most {MOST_BYTES}: list the `sources` without it"),
        ));
    }
    Ok(Digest::of(&std::fs::read(path).map_err(|cause| error(path, cause))?))
}

/// The files of a source, by the name under which they are known. Links are not followed, except a declared one.
fn collect(path: &Path, name: &Path, declared: bool, files: &mut Vec<(PathBuf, PathBuf)>) -> Result<(), PluginError> {
    let meta = if declared {
        std::fs::metadata(path)
    } else {
        std::fs::symlink_metadata(path)
    };
    let meta = meta.map_err(|cause| error(path, cause))?;
    if meta.is_file() {
        files.push((name.to_path_buf(), path.to_path_buf()));
        if files.len() > MOST_FILES {
            return Err(error(path, format!("there are more than {MOST_FILES} sources")));
        }
    } else if meta.is_dir() {
        for entry in std::fs::read_dir(path).map_err(|cause| error(path, cause))? {
            let entry = entry.map_err(|cause| error(path, cause))?;
            let child = PathBuf::from(entry.file_name());
            if is_source(&child) {
                collect(&entry.path(), &name.join(&child), false, files)?;
            }
        }
    }
    Ok(())
}

fn is_source(name: &Path) -> bool {
    let text = name.to_string_lossy();
    let ending = name
        .extension()
        .map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    !text.starts_with('.')
        && !NO_SOURCES.contains(&&*text)
        && ending.is_none_or(|ending| !NO_SOURCE_ENDINGS.contains(&&*ending))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, impl Fn(&Path) -> Digest) {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write(
            "plugin.yaml",
            "gear-plugin: 1\nname: a\ncommand: [python, worker.py]\nlock: req.txt\n",
        );
        write("worker.py", "pass");
        write("lib/more.py", "pass");
        write("req.txt", "numpy==2");
        let digest = |folder: &Path| fingerprint(folder, &Manifest::read(folder).unwrap()).unwrap();
        (folder, digest)
    }

    #[test]
    fn sources_and_the_lock_file_count() {
        let (folder, digest) = folder();
        let mut seen = vec![digest(folder.path())];
        for (name, text) in [
            ("worker.py", "go()"),
            ("lib/more.py", "x"),
            ("req.txt", "numpy==3"),
            ("new.py", ""),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
            let now = digest(folder.path());
            assert!(!seen.contains(&now), "{name}");
            seen.push(now);
        }
    }

    #[test]
    fn what_is_installed_made_or_learnt_does_not_count() {
        let (folder, digest) = folder();
        let before = digest(folder.path());
        for name in [
            ".venv/lib/x.py",
            "__pycache__/a.pyc",
            "lib/__pycache__/b.py",
            "weights.safetensors",
            "m.ONNX",
            ".git/x",
        ] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "anything").unwrap();
        }
        assert_eq!(digest(folder.path()), before);
    }

    #[test]
    fn the_place_of_the_folder_does_not_count() {
        let ((a, digest), (b, _)) = (folder(), folder());
        assert_eq!(digest(a.path()), digest(b.path()));
    }

    #[test]
    fn a_declared_source_that_is_not_there_is_told() {
        let (folder, _) = folder();
        std::fs::remove_file(folder.path().join("req.txt")).unwrap();
        let manifest = Manifest::read(folder.path()).unwrap();
        let told = fingerprint(folder.path(), &manifest).unwrap_err().to_string();
        assert!(
            told.contains("req.txt") && told.contains("declared in plugin.yaml"),
            "{told}"
        );
    }
}
