//! Experiments over graphs: ablations, error against run time, stiff and extreme cases, pinned snapshots, people's
//! preference, and the comparison of two runs.
//!
//! Nothing here knows a node: a registry and a graph are given, and outputs are compared by the norms that their value
//! types have.

pub mod curve;
pub mod diff;
pub mod norms;
mod overlay;
mod read;
pub mod stats;
pub mod study;
#[cfg(test)]
mod testing;
