//! Experiments over graphs: ablations, error against run time, stiff and extreme cases, pinned snapshots, people's
//! preference, and the comparison of two runs.
//!
//! Nothing here knows a node: a registry and a graph are given, and outputs are compared by the norms that their value
//! types have.

pub mod ballot;
mod csv;
pub mod curve;
pub mod diff;
pub mod norms;
mod overlay;
mod painting;
pub mod planes;
mod random;
mod read;
pub mod snap;
pub mod stats;
pub mod stress;
pub mod study;
#[cfg(test)]
mod testing;

/// YAML text as JSON, such as the value behind `--set PARAM=`.
pub fn yaml(text: &str) -> Result<serde_json::Value, String> {
    serde_saphyr::from_str(text).map_err(|error| error.to_string())
}
