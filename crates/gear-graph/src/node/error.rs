//! Why a node did not give its outputs.

use std::error::Error;

use crate::ValueError;

/// Why a node (or a loader) failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NodeError {
    /// The run was interrupted; see [`crate::Context::checkpoint`].
    #[error("interrupted")]
    Cancelled,

    /// The value at an input port cannot be used.
    #[error("input `{port}`: {problem}")]
    Input {
        /// The port.
        port: String,
        /// What was found and what was expected.
        problem: String,
    },

    /// Parameters that are each in range do not fit together.
    #[error("parameter `{param}`: {problem}")]
    Param {
        /// The parameter.
        param: String,
        /// What was found and what was expected.
        problem: String,
    },

    /// `demand` looked at a port whose value is not known yet.
    #[error("the value of `{port}` is not known yet")]
    Unknown {
        /// The port.
        port: String,
    },

    /// Anything else.
    #[error("{message}")]
    Failed {
        /// What was found, what was expected, what to do.
        message: String,
        /// The cause.
        #[source]
        source: Option<Box<dyn Error + Send + Sync>>,
    },
}

impl NodeError {
    /// A failure told in a sentence: what was found, what was expected, what to do.
    pub fn new(message: impl Into<String>) -> Self {
        Self::Failed {
            message: message.into(),
            source: None,
        }
    }

    /// A failure with a cause.
    pub fn because(message: impl Into<String>, source: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Failed {
            message: message.into(),
            source: Some(source.into()),
        }
    }

    /// The value at input `port` cannot be used.
    pub fn input(port: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Input {
            port: port.into(),
            problem: problem.into(),
        }
    }

    /// Parameter `param` does not fit the others.
    pub fn param(param: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Param {
            param: param.into(),
            problem: problem.into(),
        }
    }

    /// The message and those of its causes, outermost first.
    pub fn chain(&self) -> Vec<String> {
        let mut chain = vec![self.to_string()];
        let mut source = self.source();
        while let Some(cause) = source {
            chain.push(cause.to_string());
            source = cause.source();
        }
        chain
    }
}

impl From<ValueError> for NodeError {
    fn from(error: ValueError) -> Self {
        Self::new(error.to_string())
    }
}

impl From<std::io::Error> for NodeError {
    fn from(error: std::io::Error) -> Self {
        Self::new(error.to_string())
    }
}
