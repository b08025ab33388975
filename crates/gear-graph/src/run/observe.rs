//! What happens in a run, while it happens.

use crate::{AnyValue, Digest, Progress};

use super::Failure;

/// Something that happened. Names are those of nodes (`ratio`) or inputs (`painting`).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The run begins; so many nodes and inputs may have something to do.
    Started {
        /// How many.
        sites: usize,
    },
    /// A node runs, or an input is loaded.
    Running {
        /// Its name.
        node: &'a str,
        /// Its type.
        type_name: &'a str,
        /// The outputs that are computed.
        outputs: &'a [&'a str],
    },
    /// A running node tells how far it is.
    Progress {
        /// Its name.
        node: &'a str,
        /// How far.
        progress: &'a Progress,
    },
    /// A node is done.
    Ran {
        /// Its name.
        node: &'a str,
        /// Seconds on the clock.
        seconds: f64,
    },
    /// A node computed an output (or an input was loaded). Whoever wants more of the value than a glance shares it and
    /// works elsewhere; it lives as long as somebody holds it.
    Value {
        /// The node's or input's name.
        node: &'a str,
        /// The output; the input's name for an input.
        output: &'a str,
        /// The value's digest.
        digest: &'a Digest,
        /// The value.
        value: &'a AnyValue,
    },
    /// An output was known to the store.
    Hit {
        /// The node's or input's name.
        node: &'a str,
        /// The output.
        output: &'a str,
        /// The value's digest.
        digest: &'a Digest,
    },
    /// A node failed.
    Failed {
        /// What happened.
        failure: &'a Failure,
    },
    /// A node cannot run because another failed.
    Skipped {
        /// Its name.
        node: &'a str,
        /// The node that failed.
        because_of: &'a str,
    },
    /// Something is odd, but the run goes on.
    Warning {
        /// What.
        message: &'a str,
    },
    /// A note that a node left for the user.
    Note {
        /// Its name.
        node: &'a str,
        /// The note.
        note: &'a str,
    },
}

/// Hears what happens. Called from several threads, and must return quickly.
pub trait Observer: Send + Sync {
    /// Something happened.
    fn event(&self, event: &Event<'_>);
}

impl<F: Fn(&Event<'_>) + Send + Sync> Observer for F {
    fn event(&self, event: &Event<'_>) {
        self(event);
    }
}
