//! `gear new-plugin`: the folder of a new plugin in Python, which works as it stands.
//!
//! The Python package that it is written with comes along, so that the folder needs nothing of gear's repository.

use std::path::{Path, PathBuf};

use clap::Args;
use gear_graph::Registry;

use crate::console::Console;
use crate::error::{CliError, Exit};

/// `gear new-plugin`.
#[derive(Debug, Args)]
pub struct NewPluginArgs {
    /// Its name, such as warm-light: the folder to make, and its node WarmLight
    pub name: String,
    /// Where the folder goes
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub to: PathBuf,
}

/// Why no plugin was written.
#[derive(Debug, thiserror::Error)]
#[error("new-plugin: {0}; nothing was written")]
pub struct Refusal(String);

/// The Python package `gear_sdk`: name and text of every file.
const SDK: &[(&str, &str)] = {
    macro_rules! embed {
        ($($name:literal),* $(,)?) => {
            &[$(($name, include_str!(concat!("../../../../../nodes/python/gear_sdk/", $name)))),*]
        };
    }
    embed![
        "__init__.py",
        "context.py",
        "cutout.py",
        "exr.py",
        "geometry.py",
        "params.py",
        "plugin.py",
        "ply.py",
        "png.py",
        "pose.py",
        "py.typed",
        "values.py",
        "weights.py",
    ]
};

pub fn new_plugin(args: &NewPluginArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let node = node_name(&args.name).map_err(Refusal)?;
    if registry.find_node(&node).is_some() {
        return Err(Refusal(format!("there is a node type `{node}` already; choose another name")).into());
    }
    let folder = args.to.join(&args.name);
    if folder.exists() {
        return Err(Refusal(format!("{} exists already", folder.display())).into());
    }
    // Under another name first: a half plugin never stands under its own.
    let write = || -> std::io::Result<()> {
        std::fs::create_dir_all(&args.to)?;
        let whole = tempfile::Builder::new().prefix(".new-plugin-").tempdir_in(&args.to)?;
        for (name, text) in files(&args.name, &node) {
            put(whole.path(), &name, &text)?;
        }
        std::fs::rename(whole.path(), &folder)
    };
    write().map_err(|cause| CliError::Write {
        file: folder.clone(),
        cause,
    })?;
    let shown = folder.display();
    console.result(&format!(
        "{shown}: the node {node}, in worker.py\n\nits Python needs numpy; for one of its own:\n  \
         python3 -m venv {shown}/.venv\n  {shown}/.venv/bin/pip install -r {shown}/requirements.txt\n\n\
         try it:\n  gear plugin check {shown}\n  gear nodes {node} --plugin {shown}"
    ));
    Ok(Exit::Done)
}

fn put(folder: &Path, name: &str, text: &str) -> std::io::Result<()> {
    let path = folder.join(name);
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent)?;
    }
    std::fs::write(path, text)
}

/// `warm-light` → `WarmLight`.
fn node_name(name: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let words = name.split('-');
    if name.len() > 64
        || !name.chars().all(plain)
        || words
            .clone()
            .any(|word| !word.starts_with(|c: char| c.is_ascii_lowercase()))
    {
        return Err(format!(
            "`{name}` must be words of small letters and digits joined by `-`, such as warm-light"
        ));
    }
    Ok(words.map(|word| word[..1].to_ascii_uppercase() + &word[1..]).collect())
}

fn files(name: &str, node: &str) -> Vec<(String, String)> {
    let filled = |text: &str| text.replace("@name@", name).replace("@Node@", node);
    let mut files = vec![
        (
            "plugin.yaml".to_owned(),
            filled(include_str!("templates/plugin.yaml.in")),
        ),
        ("worker.py".to_owned(), filled(include_str!("templates/worker.py.in"))),
        (
            "test_worker.py".to_owned(),
            filled(include_str!("templates/test_worker.py.in")),
        ),
        ("README.md".to_owned(), filled(include_str!("templates/README.md.in"))),
        ("requirements.txt".to_owned(), "numpy>=1.22\n".to_owned()),
    ];
    files.extend(
        SDK.iter()
            .map(|(name, text)| (format!("gear_sdk/{name}"), (*text).to_owned())),
    );
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_folders_make_names_of_nodes() {
        assert_eq!(node_name("warm-light").unwrap(), "WarmLight");
        assert_eq!(node_name("blur2").unwrap(), "Blur2");
        for odd in ["", "Warm", "warm--light", "-warm", "../warm", "warm_light", "2d"] {
            assert!(node_name(odd).is_err(), "{odd}");
        }
    }

    #[test]
    fn the_whole_package_comes_along() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../nodes/python/gear_sdk");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files = files.filter(|path| path.is_file());
        let mut found: Vec<_> = files
            .map(|path| path.file_name().unwrap().display().to_string())
            .collect();
        found.sort();
        let mut embedded: Vec<_> = SDK.iter().map(|(name, _)| (*name).to_owned()).collect();
        embedded.sort();
        assert_eq!(found, embedded);
    }
}
