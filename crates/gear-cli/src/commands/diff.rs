//! `gear diff`: what differs between two runs.

use std::path::PathBuf;

use clap::Args;
use gear_graph::Registry;
use gear_study::diff::outputs::Values;
use gear_study::diff::{Record, compare, text};

use crate::args::TextFormat;
use crate::console::Console;
use crate::error::{CliError, Exit};

/// `gear diff`.
#[derive(Debug, Args)]
pub struct DiffArgs {
    /// The output folder of a run, or its run.json
    #[arg(value_name = "RUN_A")]
    pub a: PathBuf,
    /// The other one
    #[arg(value_name = "RUN_B")]
    pub b: PathBuf,
    /// Where values are looked up [default: the store of each run, if it is there, then its folder]
    #[arg(long, value_name = "DIR")]
    pub store: Option<PathBuf>,
    /// Show every number that differs in reports, not only the largest differences
    #[arg(long)]
    pub all: bool,
    /// For people, or for programs
    #[arg(long, value_enum, default_value_t = TextFormat::Text)]
    pub format: TextFormat,
    /// End with 1 if an output differs
    #[arg(long)]
    pub exit_code: bool,
}

pub fn diff(args: &DiffArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let (a, b) = (Record::open(&args.a)?, Record::open(&args.b)?);
    let comparison = compare(&a, &b, &Values::of(&a, &b, args.store.as_deref(), registry));
    match args.format {
        TextFormat::Text => console.result(text::text(&comparison, args.all).trim_end()),
        TextFormat::Json => {
            let json = serde_json::to_string_pretty(&comparison).map_err(|error| CliError::Encode {
                output: "comparison".to_owned(),
                cause: error.to_string(),
            })?;
            console.result(&json);
        }
    }
    Ok(match args.exit_code && !comparison.same_outputs() {
        true => Exit::Failed,
        false => Exit::Done,
    })
}
