//! `plugin.yaml`: which program to start, with what environment, and what its results depend on.
//!
//! Only what stands here is given to the program: no variable of the user's environment that is not listed, no shell.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_saphyr::{MessageFormatter, UserMessageFormatter};

use crate::PluginError;
use crate::lines::for_people;

/// The name of the file that makes a folder a plugin.
pub const FILE_NAME: &str = "plugin.yaml";

/// The version of the format.
const FORMAT: u32 = 1;

/// A manifest larger than this is none.
const MOST_BYTES: u64 = 1 << 16;

/// Variables that every worker gets: without them hardly a program starts.
pub(crate) const ALWAYS_PASSED: &[&str] = if cfg!(windows) {
    &["PATH", "SystemRoot", "PATHEXT"]
} else {
    &["PATH"]
};

/// `plugin.yaml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Manifest {
    /// The version of this format: 1.
    pub gear_plugin: u32,
    /// The plugin's name: small letters, digits and `-`.
    pub name: String,
    /// What it is for, in a sentence.
    #[serde(default)]
    pub doc: String,
    /// The program and its arguments. A program with a `/` is relative to the folder; `python` is the folder's own
    /// `.venv` if there is one, else the first of `python3` and `python` on the path.
    #[serde(deserialize_with = "program_and_arguments")]
    pub command: Vec<String>,
    /// Variables that the program gets.
    #[serde(default)]
    pub environment: Environment,
    /// What it needs of the machine.
    #[serde(default)]
    pub resources: Resources,
    /// Files and folders that its results depend on, relative to the folder.
    #[serde(default = "whole_folder")]
    pub sources: Vec<PathBuf>,
    /// The file that pins what it is built upon, such as requirements.txt.
    #[serde(default)]
    pub lock: Option<PathBuf>,
    /// A file in which the nodes stand described, so that graphs are checked without starting anything.
    #[serde(default)]
    pub nodes: Option<PathBuf>,
    /// How long to wait.
    #[serde(default)]
    pub timeouts: Timeouts,
    /// How much to take.
    #[serde(default)]
    pub limits: Limits,
}

/// Variables that the program gets besides `PATH` and the folder for temporary files.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Environment {
    /// Names of variables that are passed on as the user has them.
    #[serde(default)]
    pub pass: Vec<String>,
    /// Variables with their values.
    #[serde(default)]
    pub set: BTreeMap<String, String>,
}

/// What a worker needs of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Resources {
    /// GPUs while a node runs: 0 or 1. Nodes of all plugins that need one take turns.
    #[serde(default)]
    pub gpu: u32,
}

/// Seconds to wait for a worker.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Timeouts {
    /// From its start to its handshake.
    pub start: f64,
    /// For a node.
    pub run: f64,
    /// From the request to stop to its end.
    pub cancel: f64,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            start: 120.0,
            run: 3600.0,
            cancel: 5.0,
        }
    }
}

/// What is taken from a worker at most.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Limits {
    /// Megabytes of a file that it gives, and of what the file unpacks to.
    pub output_mb: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { output_mb: 1024 }
    }
}

impl Limits {
    /// [`Limits::output_mb`] in bytes.
    pub fn output_bytes(&self) -> u64 {
        self.output_mb.saturating_mul(1 << 20)
    }
}

impl Timeouts {
    pub(crate) fn start(&self) -> Duration {
        Duration::from_secs_f64(self.start)
    }

    pub(crate) fn run(&self) -> Duration {
        Duration::from_secs_f64(self.run)
    }

    pub(crate) fn cancel(&self) -> Duration {
        Duration::from_secs_f64(self.cancel)
    }
}

/// What is wrong with the YAML, and on which line.
fn told(error: &serde_saphyr::Error) -> String {
    let error = error.without_snippet();
    let message = UserMessageFormatter.format_message(error);
    let message = for_people(&message);
    match error.location() {
        Some(at) => format!("line {}: {message}", at.line()),
        None => message,
    }
}

/// A list. One line, as for a shell, is the mistake that people make, so it has a message of its own.
fn program_and_arguments<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    struct List;
    impl<'de> Visitor<'de> for List {
        type Value = Vec<String>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a list such as [python, worker.py]")
        }

        fn visit_str<E: serde::de::Error>(self, line: &str) -> Result<Self::Value, E> {
            let words: Vec<_> = line.split_whitespace().collect();
            Err(E::custom(format!(
                "`command` is a list, such as [{}]: there is no shell that would take a line apart",
                words.join(", ")
            )))
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Self::Value, A::Error> {
            let mut list = Vec::new();
            while let Some(item) = items.next_element()? {
                list.push(item);
            }
            if list.is_empty() {
                return Err(A::Error::custom("`command` must be a list that begins with a program"));
            }
            Ok(list)
        }
    }
    deserializer.deserialize_any(List)
}

fn whole_folder() -> Vec<PathBuf> {
    vec![PathBuf::from(".")]
}

impl Manifest {
    /// Reads the manifest of a folder.
    ///
    /// # Errors
    /// If it is not there, is no YAML, has unknown keys, or says what cannot be.
    pub fn read(folder: &Path) -> Result<Self, PluginError> {
        let path = folder.join(FILE_NAME);
        let unreadable = |cause| PluginError::Unreadable {
            path: path.clone(),
            cause,
        };
        if std::fs::metadata(&path).map_err(unreadable)?.len() > MOST_BYTES {
            let cause = format!("is larger than {MOST_BYTES} bytes");
            return Err(PluginError::Manifest { path, cause });
        }
        let text = std::fs::read_to_string(&path).map_err(unreadable)?;
        Self::parse(&text).map_err(|cause| PluginError::Manifest { path, cause })
    }

    /// Reads a manifest from its text.
    fn parse(text: &str) -> Result<Self, String> {
        let manifest: Self = serde_saphyr::from_str(text).map_err(|error| told(&error))?;
        let Timeouts { start, run, cancel } = manifest.timeouts;
        let odd_name = |name: &String| name.is_empty() || name.contains(['=', '\0']);
        let variables = manifest.environment.pass.iter().chain(manifest.environment.set.keys());
        if manifest.gear_plugin != FORMAT {
            let found = manifest.gear_plugin;
            return Err(format!(
                "`gear-plugin: {found}` is another version of the format; this gear knows {FORMAT}"
            ));
        }
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if manifest.name.is_empty() || manifest.name.len() > 64 || !manifest.name.chars().all(plain) {
            return Err(format!(
                "`name: {}` must be small letters, digits and `-`",
                manifest.name
            ));
        }
        if manifest.command.first().is_none_or(|program| program.trim().is_empty()) {
            return Err("`command` must be a list that begins with a program".to_owned());
        }
        if let Some(odd) = variables.into_iter().find(|name| odd_name(name)) {
            return Err(format!("`{odd}` under `environment` is no name of a variable"));
        }
        // Up to a month; what is longer is a slip, and overflows clocks somewhere.
        let sensible = |seconds: f64| seconds > 0.0 && seconds <= 2_678_400.0;
        if !(sensible(start) && sensible(run) && sensible(cancel)) {
            return Err("`timeouts` are seconds, above 0 and at most 2678400".to_owned());
        }
        if manifest.limits.output_mb == 0 || manifest.resources.gpu > 1 {
            return Err("`limits: {output-mb: …}` must be above 0, and `resources: {gpu: …}` 0 or 1".to_owned());
        }
        Ok(manifest)
    }

    /// The program and its arguments, with the program found.
    pub(crate) fn program(&self, folder: &Path) -> PathBuf {
        let program = Path::new(&self.command[0]);
        if self.command[0] == "python" {
            let own = if cfg!(windows) {
                folder.join(".venv/Scripts/python.exe")
            } else {
                folder.join(".venv/bin/python")
            };
            if own.exists() {
                return own;
            }
            return on_path("python3")
                .or_else(|| on_path("python"))
                .unwrap_or("python3".into());
        }
        if program.components().count() > 1 && program.is_relative() {
            return folder.join(program);
        }
        program.to_path_buf()
    }
}

fn on_path(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let name = format!("{program}{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&path)
        .map(|folder| folder.join(&name))
        .find(|file| file.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "gear-plugin: 1\nname: blur\ncommand: [python, worker.py]\n";

    #[test]
    fn a_few_lines_make_a_plugin() {
        let manifest = Manifest::parse(SMALL).unwrap();
        assert_eq!(manifest.name, "blur");
        assert_eq!(manifest.sources, [PathBuf::from(".")]);
        assert!(
            manifest.environment.pass.is_empty(),
            "nothing is passed on unless it is said"
        );
        assert_eq!(manifest.limits.output_bytes(), 1 << 30);
    }

    #[test]
    fn what_cannot_be_is_told() {
        let refused = |more: &str| Manifest::parse(&format!("{SMALL}{more}")).unwrap_err();
        assert!(refused("comand: [x]\n").contains("comand"));
        assert!(refused("timeouts: {run: 0}\n").contains("above 0"));
        assert!(refused("timeouts: {run: .inf}\n").contains("seconds"));
        assert!(refused("environment: {set: {'A=B': x}}\n").contains("no name of a variable"));
        assert!(refused("resources: {gpu: 4}\n").contains("0 or 1"));
        assert!(refused("name: a\n").starts_with("line 4: ") && !refused("name: a\n").contains("Policy"));
        assert!(refused("timeouts: {run: long}\n").starts_with("line 4: "));
        let wrong = |text: &str| Manifest::parse(text).unwrap_err();
        assert!(wrong("gear-plugin: 1\nname: a\ncommand: python worker.py\n").contains("such as [python, worker.py]"));
        assert!(wrong("gear-plugin: 2\nname: a\ncommand: [x]\n").contains("another version"));
        assert!(wrong("gear-plugin: 1\nname: ../a\ncommand: [x]\n").contains("small letters"));
        assert!(wrong("gear-plugin: 1\nname: a\ncommand: []\n").contains("begins with a program"));
    }

    #[test]
    fn a_program_of_the_folder_is_found_there_and_others_on_the_path() {
        let program = |command: &str| {
            let text = format!("gear-plugin: 1\nname: a\ncommand: [{command}]\n");
            Manifest::parse(&text).unwrap().program(Path::new("/plugins/a"))
        };
        assert_eq!(program("bin/worker"), Path::new("/plugins/a/bin/worker"));
        assert_eq!(program("worker"), Path::new("worker"));
        assert_eq!(program("/usr/bin/worker"), Path::new("/usr/bin/worker"));
    }
}
