//! `gear plugin`: tests a plugin, and writes down what it says of its nodes.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use gear_graph::Registry;
use gear_plugin::{NodesFile, Plugin};
use serde_json::{Value, json};

use crate::bundle::File;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;

/// `gear plugin`.
#[derive(Debug, Subcommand)]
pub enum PluginCommand {
    /// Test a plugin: protocol, determinism, and its nodes on extreme inputs; exit code 1 if anything is wrong
    Check(PluginCheckArgs),
    /// Ask a plugin for the description of its nodes
    ///
    /// Written into the file that `nodes:` of its plugin.yaml names; printed if it names none.
    Describe {
        /// Its folder
        dir: PathBuf,
    },
}

/// `gear plugin check`.
#[derive(Debug, Args)]
pub struct PluginCheckArgs {
    /// Its folder
    pub dir: PathBuf,
    /// Parameters to test its nodes with, as JSON: what makes them quick, or has no default
    #[arg(long, value_name = "{NODE: {PARAM: VALUE}}", default_value = "{}", value_parser = params)]
    pub with: Value,
}

fn params(text: &str) -> Result<Value, String> {
    let value: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let map = |value: &Value| value.as_object().is_some_and(|map| map.values().all(Value::is_object));
    map(&value)
        .then_some(value)
        .ok_or_else(|| "expected a map of nodes to maps of parameters".to_owned())
}

pub fn plugin(command: &PluginCommand, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    match command {
        PluginCommand::Check(args) => Ok(check(args, registry, console)),
        PluginCommand::Describe { dir } => describe(dir, console),
    }
}

fn check(args: &PluginCheckArgs, registry: &Registry, console: &Console) -> Exit {
    // A test that fails does so by a panic, which is told as a finding.
    let silent = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let well = gear_plugin::conformance(&args.dir, registry, &args.with, &mut |finding| match &finding.wrong {
        None => console.result(&format!("ok     {}", finding.what)),
        Some(wrong) => console.result(&format!(
            "WRONG  {}\n       {}",
            finding.what,
            wrong.replace('\n', "\n       ")
        )),
    });
    std::panic::set_hook(silent);
    if well { Exit::Done } else { Exit::Failed }
}

fn describe(dir: &Path, console: &Console) -> Result<Exit, CliError> {
    let mistake = |cause| CliError::Plugin {
        folder: dir.to_path_buf(),
        cause,
    };
    let plugin = Plugin::ask(dir).map_err(mistake)?;
    let text = json!(NodesFile::new(plugin.nodes().to_vec()));
    let Some(name) = &plugin.manifest().nodes else {
        console.result(&format!("{text:#}"));
        return Ok(Exit::Done);
    };
    let file = File::new(name.display().to_string(), format!("{text:#}\n").into_bytes());
    let written = Folder::probe(plugin.folder())?.write(&file)?;
    console.result(&written.display().to_string());
    Ok(Exit::Done)
}
