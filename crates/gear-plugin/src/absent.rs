//! Node types of plugins that are known and not installed: a graph that uses them is checked like any other, and fails
//! where it would run them, with the words that say what to do.

use std::sync::Arc;

use gear_graph::{
    AnyValue, Context, Foreign, NodeError, NodeSpec, ParamValues, Registry, Resources, Slot, Want, interned,
};

use crate::PluginError;
use crate::describe::{self, NodesFile};

struct Absent {
    node: &'static str,
    plugin: String,
    install: String,
}

impl Foreign for Absent {
    fn realm(&self, _: &Resources) -> String {
        format!("plugin:{}:not-installed", self.plugin)
    }

    fn run(&self, _: &ParamValues, _: &mut [Slot], _: &Want, _: &Context) -> Result<Vec<Option<AnyValue>>, NodeError> {
        Err(NodeError::new(format!(
            "`{}` is a node of the plugin `{}`, and no folder with it was named; {}",
            self.node, self.plugin, self.install
        )))
    }
}

/// Adds the node types of the plugin `plugin`, described in the text of a [`NodesFile`], as far as the registry has none
/// of their names: then a folder with the plugin was named. `install` says what to do to have it, and ends an error.
///
/// # Errors
/// If the descriptions cannot be taken.
pub fn register_absent(
    registry: &mut Registry,
    plugin: &str,
    described: &str,
    install: &str,
) -> Result<(), PluginError> {
    let refused = |cause: String| PluginError::Description {
        plugin: plugin.to_owned(),
        cause,
    };
    let file = NodesFile::parse(described).map_err(refused)?;
    for spec in describe::specs(plugin, &file.nodes, registry).map_err(refused)? {
        let name = spec.name;
        if registry.find_node(name).is_some() {
            continue;
        }
        let body = Arc::new(Absent {
            node: name,
            plugin: plugin.to_owned(),
            install: install.to_owned(),
        });
        let spec = NodeSpec {
            plugin: Some(interned(&format!("{plugin}, not installed"))),
            ..spec
        };
        registry
            .foreign(spec, body)
            .map_err(|error| refused(error.to_string()))?;
    }
    Ok(())
}
