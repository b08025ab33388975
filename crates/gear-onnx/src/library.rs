//! Finding the ONNX Runtime library, and making it ready once a process.
//!
//! In this order: the file that the run names ([`LibraryFile`], `--onnxruntime FILE`), the file that `ORT_DYLIB_PATH`
//! names, the `onnxruntime` package of the active Python environment, the system. A file that was named and cannot be
//! used is an error, never a reason to look further. The library is code: so it is named by the person who runs gear,
//! and never in a graph, which may come from anybody.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use gear_graph::Resources;

use crate::{OnnxError, dylib};

/// A resource of a run: the library's file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LibraryFile(pub PathBuf);

/// The library, ready.
#[derive(Debug)]
pub struct Library {
    environment: ort::environment::Environment,
    version: String,
    path: PathBuf,
}

impl Library {
    /// Such as `1.22.0`.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The file it was loaded from, or the name that the system's loader knows it by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn environment(&self) -> &ort::environment::Environment {
        &self.environment
    }
}

/// One library a process.
static LOADED: Mutex<Option<Arc<Library>>> = Mutex::new(None);

/// The library, loaded when it is first asked for.
pub fn open(resources: &Resources) -> Result<Arc<Library>, OnnxError> {
    let named = resources.get::<LibraryFile>().map(|file| file.0.clone());
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(library) = &*loaded {
        return match named {
            Some(asked) if !same_file(&asked, &library.path) => Err(OnnxError::OtherLibrary {
                loaded: library.path.clone(),
                asked,
            }),
            _ => Ok(Arc::clone(library)),
        };
    }
    let library = Arc::new(find(named, &Surroundings::of_process())?);
    tracing::info!(path = %library.path.display(), version = library.version, "ONNX Runtime");
    *loaded = Some(Arc::clone(&library));
    Ok(library)
}

fn same_file(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    real(a) == real(b)
}

/// What of the environment tells where the library is.
#[derive(Clone, Debug, Default)]
struct Surroundings {
    ort_dylib_path: Option<OsString>,
    virtual_env: Option<OsString>,
    conda_prefix: Option<OsString>,
    path: Option<OsString>,
}

impl Surroundings {
    fn of_process() -> Self {
        let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        Self {
            ort_dylib_path: set("ORT_DYLIB_PATH"),
            virtual_env: set("VIRTUAL_ENV"),
            conda_prefix: set("CONDA_PREFIX"),
            path: set("PATH"),
        }
    }

    /// The folders in which the active Python keeps its packages. Python itself is not asked: nothing is started.
    fn prefixes(&self) -> Vec<PathBuf> {
        let mut prefixes: Vec<PathBuf> = [&self.virtual_env, &self.conda_prefix]
            .into_iter()
            .flatten()
            .map(PathBuf::from)
            .collect();
        let folders: Vec<PathBuf> = self.path.iter().flat_map(std::env::split_paths).collect();
        for name in ["python3", "python", "python.exe"] {
            let found = folders
                .iter()
                .map(|folder| folder.join(name))
                .find(|file| file.is_file());
            // `bin/python3` of a prefix is often a link into it.
            let prefix = |file: &Path| file.parent()?.parent().map(Path::to_path_buf);
            prefixes.extend(found.iter().filter_map(|file| prefix(file)));
            prefixes.extend(found.and_then(|file| prefix(&file.canonicalize().ok()?)));
        }
        prefixes
    }
}

fn find(named: Option<PathBuf>, around: &Surroundings) -> Result<Library, OnnxError> {
    if let Some(path) = named.or_else(|| around.ort_dylib_path.as_ref().map(PathBuf::from)) {
        return load(&path).map_err(|cause| OnnxError::BadLibrary { path, cause });
    }
    let mut tried = Vec::new();
    for path in in_python(around) {
        match load(&path) {
            Ok(library) => return Ok(library),
            Err(cause) => tried.push(format!("{}: {cause}", path.display())),
        }
    }
    if tried.is_empty() {
        tried.push("no `onnxruntime` package in the active Python environment".to_owned());
    }
    let system = PathBuf::from(format!(
        "{}onnxruntime{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    ));
    load(&system).map_err(|_| {
        tried.push(format!("no usable {} in the system", system.display()));
        OnnxError::NoLibrary { tried }
    })
}

/// The libraries of `onnxruntime` packages, sorted.
fn in_python(around: &Surroundings) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for prefix in around.prefixes() {
        let mut packages = vec![prefix.join("Lib").join("site-packages")];
        for entry in entries(&prefix.join("lib")) {
            let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with("python3") {
                packages.push(entry.join("site-packages"));
            }
        }
        for folder in packages {
            found.extend(
                entries(&folder.join("onnxruntime").join("capi"))
                    .into_iter()
                    .filter(|file| is_library(file)),
            );
        }
    }
    found.dedup();
    found
}

fn is_library(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    // `libonnxruntime_providers_shared.so` and the like lie beside it.
    name == "onnxruntime.dll"
        || name == "libonnxruntime.so"
        || name.starts_with("libonnxruntime.so.")
        || (name.starts_with("libonnxruntime.") && name.ends_with(".dylib"))
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let read = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut entries: Vec<_> = read.map(|entry| entry.path()).collect();
    entries.sort();
    entries
}

fn load(path: &Path) -> Result<Library, String> {
    let version = dylib::version(path)?;
    let environment = ort::init_from(path)
        .map_err(|error| error.to_string())?
        .with_name("gear")
        .with_telemetry(false)
        .build()
        .map_err(|error| error.to_string())?;
    environment.set_log_level(ort::logging::LogLevel::Error);
    Ok(Library {
        environment,
        version,
        path: path.to_path_buf(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn python(root: &Path, name: &str) -> PathBuf {
        let folder = root.join("lib/python3.12/site-packages/onnxruntime/capi");
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join(name);
        std::fs::write(&file, b"not a library").unwrap();
        file
    }

    #[test]
    fn the_package_of_the_active_environment_is_found_and_its_other_libraries_are_not() {
        let (env, on_path) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let first = python(env.path(), "libonnxruntime.so.1.22.0");
        python(env.path(), "libonnxruntime_providers_shared.so");
        let second = python(on_path.path(), "libonnxruntime.1.22.0.dylib");
        let bin = on_path.path().join("bin");
        std::fs::create_dir_all(&bin).unwrap();
        std::fs::write(bin.join("python3"), b"").unwrap();
        let around = Surroundings {
            virtual_env: Some(env.path().into()),
            path: Some(bin.into()),
            ..Surroundings::default()
        };
        let found = in_python(&around);
        assert_eq!(found[0], first);
        assert!(same_file(&found[1], &second), "{found:?}");
        assert!(in_python(&Surroundings::default()).is_empty());
    }

    #[test]
    fn a_file_that_was_named_and_is_no_library_is_an_error_that_says_how_to_get_one() {
        let folder = tempfile::tempdir().unwrap();
        let fake = python(folder.path(), "libonnxruntime.so");
        let around = Surroundings {
            ort_dylib_path: Some(fake.clone().into()),
            ..Surroundings::default()
        };
        for error in [
            find(None, &around).unwrap_err(),
            find(Some(fake.clone()), &Surroundings::default()).unwrap_err(),
        ] {
            let message = error.to_string();
            assert!(matches!(error, OnnxError::BadLibrary { .. }), "{message}");
            assert!(
                message.contains("pip install onnxruntime") && message.contains("--onnxruntime"),
                "{message}"
            );
        }
    }
}
