//! Why a service did not help.

use gear_graph::NodeError;

/// Why a service gave nothing usable. No message holds a key.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServiceError {
    /// The environment does not say where the service is.
    #[error("no {what} is set up: {name} is not set; {help}")]
    NotSetUp {
        /// The kind of service.
        what: &'static str,
        /// The variable.
        name: String,
        /// What to do.
        help: String,
    },

    /// An address that cannot be used.
    #[error("{name}: {problem}")]
    Address {
        /// The variable.
        name: String,
        /// What was found and what was expected.
        problem: String,
    },

    /// Nobody answered, however often it was tried.
    #[error("{host} did not answer ({cause}), {tries}")]
    Unreachable {
        /// The server.
        host: String,
        /// What the network said.
        cause: String,
        /// How often it was tried.
        tries: String,
    },

    /// The server refused.
    #[error("{host} answered {status}{said}")]
    Refused {
        /// The server.
        host: String,
        /// The HTTP status.
        status: u16,
        /// What it said, shortened.
        said: String,
    },

    /// The server sent us elsewhere.
    #[error(
        "{host} sends us on to {target}; answers are taken from {host} alone, so set the address to where it really is"
    )]
    Redirect {
        /// The server.
        host: String,
        /// The other host.
        target: String,
    },

    /// More bytes than an answer may have.
    #[error("the answer of {host} has more than {limit} bytes; an answer of that size is not read")]
    TooLarge {
        /// The server.
        host: String,
        /// The limit.
        limit: u64,
    },

    /// Something else came back than was asked for.
    #[error("{host} answered with {found}, expected {expected}")]
    Unexpected {
        /// The server.
        host: String,
        /// What came.
        found: String,
        /// What should have come.
        expected: String,
    },

    /// A picture that is no edit of what was sent.
    #[error(
        "the answer lost the picture's layout: its contours agree by {found:.2}, expected at least {least:.2}; ask for less \
         change in the prompt, another seed, or lower `agreement`"
    )]
    Layout {
        /// Agreement of the contours.
        found: f64,
        /// The least that is accepted.
        least: f64,
    },

    /// A workflow that cannot be used.
    #[error("the workflow {problem}")]
    Workflow {
        /// What was found and what was expected.
        problem: String,
    },

    /// The run was interrupted.
    #[error("interrupted")]
    Interrupted,
}

impl From<ServiceError> for NodeError {
    fn from(error: ServiceError) -> Self {
        match error {
            ServiceError::Interrupted => Self::Cancelled,
            ServiceError::Workflow { problem } => Self::input("workflow", problem),
            other => Self::new(other.to_string()),
        }
    }
}
