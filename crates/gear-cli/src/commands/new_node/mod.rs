//! `gear new-node`: the crate of a new node, which compiles, is registered, documented and tested.
//!
//! In gear's repository the crate goes to `nodes/`, and the node into the dependency table, the list of registrations
//! and the reference. Elsewhere the crate brings a binary of its own: `gear` plus the node. Everything is looked at
//! before anything is written, and what was written is taken back when the rest cannot be.

mod names;
mod place;
mod plan;
mod template;

use gear_graph::Registry;

use crate::args::NewNodeArgs;
use crate::console::Console;
use crate::error::{CliError, Exit};

use names::{Names, Port};
use place::Place;

/// Why no node was written.
#[derive(Debug, thiserror::Error)]
#[error("new-node: {0}; nothing was written")]
pub struct Refusal(String);

impl Refusal {
    fn new(cause: impl Into<String>) -> Self {
        Self(cause.into())
    }
}

/// A node that is to be written.
struct Draft {
    names: Names,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
}

pub fn new_node(args: &NewNodeArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let here = std::env::current_dir().map_err(|e| Refusal::new(format!("the current folder cannot be read: {e}")))?;
    let draft = draft(args, registry)?;
    let place = match &args.gear {
        Some(gear) => Place::outside(&here, gear)?,
        None => Place::find(&here)?,
    };
    let done = place.plan(&draft, registry)?.write()?;
    console.result(&done);
    Ok(Exit::Done)
}

fn draft(args: &NewNodeArgs, registry: &Registry) -> Result<Draft, Refusal> {
    let names = Names::of(&args.name, registry)?;
    let mut inputs = names::ports("--input", &args.input, registry)?;
    let mut outputs = names::ports("--output", &args.output, registry)?;
    if inputs.is_empty() && outputs.is_empty() {
        let image = ["image:Image".to_owned()];
        inputs = names::ports("--input", &image, registry)?;
        outputs = names::ports("--output", &image, registry)?;
    }
    if outputs.is_empty() {
        return Err(Refusal::new(
            "a node without outputs does nothing; give one, such as `--output image:Image`",
        ));
    }
    Ok(Draft { names, inputs, outputs })
}

#[cfg(test)]
mod tests;
