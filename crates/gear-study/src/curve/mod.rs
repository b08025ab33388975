//! Error against run time: what accuracy costs.
//!
//! A curve varies one or two knobs (parameters of nodes), times the nodes concerned, and compares a result with that of
//! a reference. The outcome is a table ([`table::Curve`]) that goes to CSV, and a work–precision diagram.
//!
//! | file | what it holds |
//! |---|---|
//! | [`mod@file`] | the file, checked completely before anything runs |
//! | [`run`] | timing |
//! | [`table`] | the CSV; programs that measure kernels write the same |
//! | [`front`] | which points are on the Pareto front, and how far from it the default is |

pub mod file;
pub mod front;
pub mod run;
pub mod table;

pub use file::Plan;
pub use table::{Curve, Point};

#[cfg(test)]
mod tests;
