//! What can be wrong with a plugin's folder, and how a worker can fail.

use std::path::PathBuf;

use gear_graph::NodeError;

/// Why a folder is no plugin that can be used.
#[derive(Debug, thiserror::Error)]
pub enum PluginError {
    /// There is no `plugin.yaml`, or it cannot be read.
    #[error("{}: cannot be read: {cause}; a plugin is a folder with a file plugin.yaml", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// `plugin.yaml` is not what it should be.
    #[error("{}: {cause}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        cause: String,
    },
    /// A declared source or lock file cannot be read.
    #[error("{}: declared in plugin.yaml, and {cause}", path.display())]
    Source {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
    /// The plugin describes its nodes in a way that cannot be.
    #[error("the plugin `{plugin}`: {cause}")]
    Description {
        /// The plugin.
        plugin: String,
        /// What was found and what was expected.
        cause: String,
    },
    /// The worker did not get as far as telling its nodes.
    #[error("the plugin `{plugin}` cannot be asked for its nodes: {failure}")]
    Worker {
        /// The plugin.
        plugin: String,
        /// How it failed.
        failure: Failure,
    },
}

/// How a worker failed at what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The program cannot be started.
    #[error("`{program}` cannot be started: {cause}; see `command` in its plugin.yaml")]
    Start {
        /// The program.
        program: String,
        /// Why.
        cause: String,
    },
    /// The process ended.
    #[error("the worker ended {when}, {how}{}", said(tail))]
    Died {
        /// During what.
        when: &'static str,
        /// With which exit code or signal.
        how: String,
        /// The last lines of its standard error.
        tail: Vec<String>,
    },
    /// It took too long and was ended.
    #[error(
        "no answer {when} in {seconds} s, so the worker was ended; see `timeouts` in its plugin.yaml{}",
        said(tail)
    )]
    TimedOut {
        /// During what.
        when: &'static str,
        /// The limit.
        seconds: f64,
        /// The last lines of its standard error.
        tail: Vec<String>,
    },
    /// It did not keep to the protocol, and was ended.
    #[error("the worker does not keep to the protocol: {cause}; it was ended{}", said(tail))]
    Protocol {
        /// What was found and what was expected.
        cause: String,
        /// The last lines of its standard error.
        tail: Vec<String>,
    },
    /// It answered with an error.
    #[error("{message}")]
    Remote {
        /// The error code of JSON-RPC.
        code: i64,
        /// What it says.
        message: String,
    },
    /// A file that it gave cannot be taken.
    #[error("output `{port}`: {cause}")]
    Output {
        /// The port.
        port: String,
        /// What was found and what was expected.
        cause: String,
    },
    /// A file for it cannot be written.
    #[error("input `{port}` cannot be handed over: {cause}")]
    Input {
        /// The port.
        port: String,
        /// Why.
        cause: String,
    },
    /// The run was interrupted.
    #[error("interrupted")]
    Cancelled,
}

impl Failure {
    /// The error of the node that was running, in the plugin of this name.
    pub fn of_node(self, plugin: &str) -> NodeError {
        match self {
            Self::Cancelled => NodeError::Cancelled,
            Self::Remote { message, .. } => NodeError::new(message),
            other => NodeError::new(format!("plugin `{plugin}`: {other}")),
        }
    }
}

fn said(tail: &[String]) -> String {
    if tail.is_empty() {
        String::new()
    } else {
        format!("; it said last:\n    {}", tail.join("\n    "))
    }
}
