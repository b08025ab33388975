//! `gear why`: why a node runs, and where stored results came from.

use std::collections::BTreeSet;

use gear_graph::{Part, Registry, Why};

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
            for why in &whys {
                match args.values {
                    true => console.result(&why.with_values().to_string()),
                    false => console.result(&why.to_string()),
                }
            }
            let sources = causes(&whys);
            if !sources.is_empty() {
                let names = sources.into_iter().map(|name| format!("`{name}`"));
                console.remark(&format!(
                    "`gear why` of {} tells why what it reads is different",
                    names.collect::<Vec<_>>().join(", ")
                ));
            }
            if !args.values && whys.iter().any(|why| why.has_more_values()) {
                console.remark("--values shows what differs in them");
            }
        }
    }
    Ok(Exit::Done)
}

/// The nodes that gave what is different, of results in which nothing else is.
fn causes(whys: &[Why]) -> BTreeSet<&str> {
    let only_inputs = whys
        .iter()
        .filter(|why| why.differences.iter().all(|difference| difference.part == Part::Input));
    let sources = only_inputs.flat_map(|why| &why.differences);
    sources
        .filter(|difference| difference.name != "file")
        .filter_map(|difference| difference.source.as_deref()?.split('.').next())
        .collect()
}
