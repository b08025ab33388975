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
pub mod ballot;
pub mod planes;
mod random;
pub mod snap;
pub mod stress;

/// YAML text as JSON, such as the value behind `--set PARAM=`.
pub fn yaml(text: &str) -> Result<serde_json::Value, String> {
    serde_saphyr::from_str(text).map_err(|error| error.to_string())
}
