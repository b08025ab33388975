//! One file a command.

pub mod ballot;
pub mod cache;
pub mod check;
pub mod convert;
pub mod curve;
pub mod diff;
pub mod graph;
pub mod graphs;
pub mod new_node;
pub mod new_plugin;
pub mod nodes;
pub mod plan;
pub mod plugin;
pub mod render;
pub mod run;
pub mod sample;
pub mod schema;
pub mod snap;
pub mod stress;
pub mod study;
pub mod why;
