//! `gear why`: why a node runs, and where stored results came from.

use gear_graph::Registry;

use crate::args::{TextFormat, WhyArgs};
use crate::console::Console;
use crate::error::{CliError, Exit};

use super::plan::{look_at_store, open, set_up};

pub fn why(args: &WhyArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let store = look_at_store(&args.run.run, console);
    let graph = open(&args.run.run, registry, store.as_deref(), console)?;
    let run = set_up(&args.run.run, &graph, store.clone())?;
    let whys = run.why(&args.node).map_err(CliError::Run)?;
    for warning in store.iter().flat_map(|store| store.warnings()) {
        console.warning(&warning);
    }
    match args.format {
        TextFormat::Json => console.result(&format!("{:#}", serde_json::json!(whys))),
        TextFormat::Text => {
            for why in whys {
                console.result(&why.to_string());
            }
        }
    }
    Ok(Exit::Done)
}
