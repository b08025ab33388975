//! `gear schema`: the JSON Schema of graph files.

use gear_graph::Registry;

use crate::console::Console;
use crate::error::{CliError, Exit};

pub fn schema(registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    console.result(&format!("{:#}", gear_graph::graph::schema(registry)));
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use boon::{Compiler, Schemas};

    use crate::graphs::shipped;

    #[test]
    fn every_shipped_graph_is_valid_by_the_schema() {
        let mut schemas = Schemas::new();
        let mut compiler = Compiler::new();
        let schema = gear_graph::graph::schema(&crate::with_shipped(crate::registry()));
        compiler.add_resource("https://example.org/graph.json", schema).unwrap();
        let index = compiler
            .compile("https://example.org/graph.json", &mut schemas)
            .unwrap();
        for graph in shipped() {
            let file: serde_json::Value = serde_saphyr::from_str(graph.text).unwrap();
            let result = schemas.validate(&file, index);
            assert!(result.is_ok(), "{}: {:#}", graph.name, result.unwrap_err());
            // It is this schema that judges: the same graph with a slip is refused.
            let slip = graph.text.replacen("nodes:", "noeds:", 1);
            let file: serde_json::Value = serde_saphyr::from_str(&slip).unwrap();
            assert!(schemas.validate(&file, index).is_err(), "{}", graph.name);
        }
    }
}
