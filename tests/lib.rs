//! What the whole-system tests share: the `gear` binary as a user types it, in a folder of its own.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// How long a command may take. The longest takes a minute; a machine that is busy with other things, several.
const PATIENCE: Duration = Duration::from_secs(900);

/// The binary that was built together with these tests: `cargo test --workspace` builds it beside them. The variable
/// `GEAR_BIN` names another.
///
/// # Panics
/// If it is not there.
pub fn binary() -> PathBuf {
    if let Some(given) = std::env::var_os("GEAR_BIN") {
        return given.into();
    }
    let test = std::env::current_exe().expect("a running test has a path");
    // target/PROFILE/deps/system-HASH
    let profile = test.ancestors().nth(2).expect("tests are built in target/PROFILE/deps");
    let binary = profile.join(format!("gear{}", std::env::consts::EXE_SUFFIX));
    assert!(
        binary.exists(),
        "{} is not there; `cargo test --workspace` builds it, or `cargo build --bin gear`",
        binary.display()
    );
    binary
}

/// A folder with a store in it, in which `gear` is run.
pub struct Desk {
    folder: TempDir,
}

/// What a command left.
#[derive(Debug)]
pub struct Done {
    /// The exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Default for Desk {
    fn default() -> Self {
        Self::new()
    }
}

impl Desk {
    /// An empty folder.
    ///
    /// # Panics
    /// If there is no place for one.
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a temporary folder"),
        }
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder; its path.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).expect("the folder can be written");
        path
    }

    /// `gear` with these arguments, in the folder, with the store `store` there.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(binary());
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .env("GEAR_STORE", self.path("store"))
            .env("XDG_CONFIG_HOME", self.path("config"))
            .env_remove("GEAR_PLUGINS")
            .env_remove("GEAR_LOG");
        command
    }

    /// Runs `gear` with these arguments.
    ///
    /// # Panics
    /// If it cannot be started, or does not end: a command that hangs is one test that fails, with what it said.
    #[track_caller]
    pub fn gear(&self, arguments: &[&str]) -> Done {
        let mut command = self.command(arguments);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().expect("gear starts");
        let stdout = gather(child.stdout.take());
        let stderr = gather(child.stderr.take());
        let started = Instant::now();
        let status = loop {
            match child.try_wait().expect("gear can be waited for") {
                Some(status) => break Some(status),
                None if started.elapsed() > PATIENCE => {
                    let _ = child.kill();
                    let _ = child.wait();
                    break None;
                }
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        };
        let text = |from: JoinHandle<Vec<u8>>| String::from_utf8_lossy(&from.join().unwrap_or_default()).into_owned();
        let (stdout, stderr) = (text(stdout), text(stderr));
        let Some(status) = status else {
            panic!(
                "`gear {}` did not end in {PATIENCE:?}; it said {stdout}{stderr}",
                arguments.join(" ")
            );
        };
        Done {
            code: status.code(),
            stdout,
            stderr,
        }
    }

    /// The names of everything in a folder, with the folders below, sorted; empty if it is not there.
    pub fn listing(&self, name: &str) -> Vec<String> {
        let mut found = Vec::new();
        let mut folders = vec![self.path(name)];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    folders.push(path);
                } else if let Ok(below) = path.strip_prefix(self.path(name)) {
                    found.push(below.display().to_string());
                }
            }
        }
        found.sort();
        found
    }

    /// The record of the run that wrote into this folder.
    ///
    /// # Panics
    /// If there is none.
    pub fn record(&self, out: &str) -> Record {
        Record(json(&self.path(out).join("run.json")))
    }
}

/// Reads a pipe to its end beside the process that fills it.
fn gather(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

impl From<Output> for Done {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Done {
    /// Asserts the exit code.
    ///
    /// # Panics
    /// If it is another; with everything that was said.
    #[track_caller]
    pub fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        self
    }

    /// Asserts that standard error says this.
    ///
    /// # Panics
    /// If it does not; with everything that was said.
    #[track_caller]
    pub fn says(self, text: &str) -> Self {
        assert!(self.stderr.contains(text), "expected {text:?} in {self:#?}");
        self
    }
}

/// A JSON file.
///
/// # Panics
/// If it is not there, or is no JSON.
pub fn json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The record of a run, `run.json`.
pub struct Record(pub Value);

impl Record {
    /// The nodes and inputs with this status, sorted.
    pub fn with_status(&self, status: &str) -> Vec<&str> {
        let nodes = self.0["nodes"].as_array().into_iter().flatten();
        let mut names: Vec<_> = nodes
            .filter(|node| node["status"] == status)
            .filter_map(|node| node["id"].as_str())
            .collect();
        names.sort_unstable();
        names
    }

    /// Digest of every output, by its name.
    pub fn outputs(&self) -> Vec<(&str, &str)> {
        let outputs = self.0["outputs"].as_array().into_iter().flatten();
        outputs
            .filter_map(|output| Some((output["name"].as_str()?, output["digest"].as_str()?)))
            .collect()
    }
}
