//! Stiff and extreme cases: one catalogue, run on any node or graph.
//!
//! The catalogue (`catalogue.yaml`) is data: named values that are extreme in one way each, and cases of single nodes
//! with the outcome that is expected. A *sweep* feeds a node every value of the types of its input ports, one port at a
//! time; the other ports get ordinary values that are made to go with it (a mask of the picture's size). A *case* is one
//! node with given parameters on given values. A graph is fed the values of the types of its inputs, and each of its
//! nodes is looked at.
//!
//! What a row says and when it is a surprise:
//!
//! ```text
//! answers   all outputs are there and without flaw     a surprise if the catalogue says that it is refused, if a number
//!                                                      is out of the stated range or too far from the f64 reference
//! refuses   an error that a user can read              a surprise if the catalogue has the node and does not say so
//! breaks    a panic, a flaw, an output that is lost    always a surprise
//! hangs     no answer in two minutes                   always a surprise
//! ```
//!
//! | file | what it holds |
//! |---|---|
//! | `catalogue` | the format of the data |
//! | `make` | recipes → values |
//! | `reference` | f64 versions of what some nodes compute |
//! | `sweep` | nodes on values, cases |
//! | `graph` | graphs on values |
//! | `table` | rows as text, Markdown, JSON |

mod catalogue;
mod graph;
mod make;
pub mod reference;
mod sweep;
mod table;

use std::time::Duration;

use gear_graph::Resources;

pub use catalogue::{Case, Catalogue, CatalogueError, Expect, Holds, Named, NodeEntry};
pub use graph::stress_graph;
pub use sweep::{stress_case, stress_node, stress_subject};
pub use table::{catalogue_markdown, json, text};

use crate::planes::Extent;

/// How a catalogue is run.
#[derive(Clone)]
pub struct Options {
    /// Values that take more bytes in memory are left out.
    pub largest: usize,
    /// Time after which a trial hangs.
    pub patience: Duration,
    /// What is lent to nodes, such as a device.
    pub resources: Resources,
}

impl Default for Options {
    /// Every value, two minutes, nothing lent.
    fn default() -> Self {
        Self {
            largest: usize::MAX,
            patience: Duration::from_secs(120),
            resources: Resources::default(),
        }
    }
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// All outputs are there and without flaw.
    Answers,
    /// An error that a user can read.
    Refuses,
    /// A panic, a flaw, an output that is lost.
    Breaks,
    /// No answer.
    Hangs,
    /// In a graph: nothing of the node was needed, or what it needs had failed.
    Idle,
}

/// One case at one node.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// The node: its type, or its id in a graph.
    pub node: String,
    /// The case: `PORT = VALUE`, or the case's name.
    pub case: String,
    /// What happened.
    pub outcome: Outcome,
    /// What was expected; none where any sensible outcome will do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<Outcome>,
    /// The error's message, or what is broken.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub message: String,
    /// The extent of all that came out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extent: Option<Extent>,
    /// The largest error against an f64 reference, as a share of its largest number or of 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Seconds of the run.
    pub seconds: f64,
    /// Why it is a surprise; none if it is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surprise: Option<String>,
}

#[cfg(test)]
mod tests;
