//! Studies: variants of a graph, run over many pictures, compared in tables.
//!
//! ```yaml
//! study: 1
//! graph: '@gear'
//! set: {painting.size: 384}
//! cases: {samples: {names: [court-lady, vessel], seed: [1, 2]}}
//! variants:
//!   fixed:    {set: {gain.mode: {fixed: {alpha: 0.8}}}}
//!   adaptive: {}
//! measures: {vend: metrics.vend}
//! ```
//!
//! | file | what it holds |
//! |---|---|
//! | [`mod@file`] | the file, checked completely before anything runs |
//! | [`cases`], [`manifest`] | what the graphs are run on |
//! | [`share`] | which nodes of which variants are one and the same |
//! | [`run`] | plans and runs |
//! | [`results`] | rows, and the numbers made of them |
//! | [`paper`] | what agrees in order with published numbers |
//! | [`report`] | tables, pages and sheets |
//!
//! Every case is run through every variant, one after the other, over one store. A variant that shares its first
//! nodes with an earlier one finds their results there: nothing is computed twice, and an interrupted study goes on
//! where it stopped. A case that fails is a row that says why.

pub mod cases;
pub mod file;
pub mod manifest;
pub mod paper;
pub mod report;
pub mod results;
pub mod run;
pub mod share;

pub use cases::{Case, Samples, Source};
pub use file::{Better, Measure, Study, Variant};
pub use results::{Results, Row};
pub use run::{Forecast, Host, Step};

#[cfg(test)]
mod tests;
