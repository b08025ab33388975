//! Two runs compared: what differed in the graph, the parameters, the keys, the outputs and the times.
//!
//! | file | what it holds |
//! |---|---|
//! | [`record`] | what `run.json` says, as far as it is compared |
//! | [`mod@compare`] | the comparison of two records |
//! | [`outputs`] | values from the stores or the output folders, and how far apart they are |
//! | [`text`] | the comparison for people |

pub mod compare;
pub mod outputs;
pub mod record;
pub mod text;

pub use compare::{Comparison, Fate, NodeDifference, compare};
pub use record::{BadRecord, Record};

#[cfg(test)]
mod tests;
