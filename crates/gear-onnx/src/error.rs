//! What can go wrong between a network's file and its answer; every message is one sentence.

use std::path::PathBuf;

use gear_graph::NodeError;

/// How to get the library, for messages.
const GET_IT: &str = "install it with `pip install onnxruntime` in the active Python environment, or take it from \
                      https://github.com/microsoft/onnxruntime/releases and name its file with `--onnxruntime FILE` or \
                      ORT_DYLIB_PATH";

/// Why a network gave no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OnnxError {
    /// The run was interrupted.
    #[error("interrupted")]
    Cancelled,
    /// No library.
    #[error("a network needs the ONNX Runtime library, which was not found ({}); {GET_IT}", tried.join("; "))]
    NoLibrary {
        /// Where it was looked for, and what was there.
        tried: Vec<String>,
    },
    /// The library that was named cannot be used.
    #[error("the ONNX Runtime library {} cannot be used: {cause}; {GET_IT}", path.display())]
    BadLibrary {
        /// The file.
        path: PathBuf,
        /// What was found.
        cause: String,
    },
    /// Another library was named before.
    #[error(
        "ONNX Runtime was loaded from {} already and {} is asked for; one process uses one library",
        loaded.display(), asked.display()
    )]
    OtherLibrary {
        /// The one in use.
        loaded: PathBuf,
        /// The one asked for.
        asked: PathBuf,
    },
    /// The library has no such provider.
    #[error(
        "this ONNX Runtime ({version}) was built without the provider `{provider}`; take a build that has it, or use `cpu`"
    )]
    NoProvider {
        /// The provider.
        provider: &'static str,
        /// The library's version.
        version: String,
    },
    /// A file is no network that can be used.
    #[error("{0}")]
    BadModel(String),
    /// The network is not what its declaration says.
    #[error("the network is not what its declaration says: {0}")]
    Mismatch(String),
    /// The library refuses the network, or fails running it.
    #[error("ONNX Runtime {doing}: {}", one_line(cause))]
    Runtime {
        /// `cannot read the network` or the like.
        doing: &'static str,
        /// Its message.
        cause: String,
    },
    /// The answer cannot be used.
    #[error("the network's answer cannot be used: {0}")]
    BadAnswer(String),
}

impl From<OnnxError> for NodeError {
    fn from(error: OnnxError) -> Self {
        match error {
            OnnxError::Cancelled => Self::Cancelled,
            error => Self::new(error.to_string()),
        }
    }
}

/// The library's messages can be long and hold line breaks and paths of its own source.
fn one_line(text: &str) -> String {
    const MOST: usize = 300;
    let line: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_of_the_library_becomes_one_short_line() {
        let error = OnnxError::Runtime {
            doing: "cannot read the network",
            cause: format!("Fail:\n  at line 3\n{}", "é".repeat(5000)),
        };
        let message = error.to_string();
        assert!(!message.contains('\n') && message.chars().count() < 400, "{message}");
    }
}
