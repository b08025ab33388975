//! What a run would do, found without computing anything.

use serde::Serialize;

use super::Run;
use super::inputs::Given;

/// What a run would do, producers first.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// The inputs and nodes.
    pub nodes: Vec<PlannedNode>,
}

/// What would become of a node or input.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedNode {
    /// Its id, or the input's name.
    pub id: String,
    /// Its type.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Whether it is a graph input.
    pub input: bool,
    /// What would become of it.
    pub state: PlannedState,
    /// Why.
    pub reason: String,
    /// Seconds that it took when it was computed last, if it is stored.
    pub seconds: Option<f64>,
}

/// What would become of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlannedState {
    /// It runs.
    Runs,
    /// It runs if what runs before it asks for it.
    MayRun,
    /// Everything needed of it is stored.
    Cached,
    /// Nothing of it is needed.
    LeftOut,
    /// An input given as a value, or an optional one that is not given.
    Given,
}

pub(super) fn plan(_run: &Run<'_>, _given: &[Given]) -> Plan {
    Plan { nodes: Vec::new() }
}
