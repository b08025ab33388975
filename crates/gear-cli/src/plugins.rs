//! Plugins: those that were named, and what is known of those that come with gear.
//!
//! A program of a plugin runs only if its folder was named on the command line (`--plugin DIR`) or in the user's
//! configuration: the variable `GEAR_PLUGINS`, or the file `plugins.yaml` in the user's configuration folder. A graph
//! file names node types, never folders.
//!
//! The plugins of `nodes/python` come with gear as descriptions: a graph that uses them is checked like any other, and
//! where it would run them it says what to do.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gear_graph::{Registry, Store};
use gear_plugin::{Plugin, PluginError};
use serde::Deserialize;

use crate::console::Console;
use crate::error::CliError;

/// A plugin that comes with gear.
#[derive(Clone, Copy, Debug)]
pub struct ShippedPlugin {
    /// Its name.
    pub name: &'static str,
    /// Its folder in gear's repository.
    pub folder: &'static str,
    /// The chapter of the book that says how to install it.
    pub chapter: &'static str,
    /// The description of its nodes.
    nodes: &'static str,
}

/// The plugins that come with gear: the folders of `nodes/python`.
pub fn shipped_plugins() -> &'static [ShippedPlugin] {
    macro_rules! embed {
        ($($name:literal in $folder:literal),* $(,)?) => {
            &[$(ShippedPlugin {
                name: $name,
                folder: concat!("nodes/python/", $folder),
                chapter: concat!("docs/src/models/", $name, ".md"),
                nodes: include_str!(concat!("../../../nodes/python/", $folder, "/nodes.json")),
            }),*]
        };
    }
    embed![
        "flux-kontext" in "flux_kontext",
        "gaussian-editor" in "gaussian_editor",
        "lgm" in "lgm",
        "splatter-image" in "splatter_image",
        "trellis" in "trellis",
    ]
}

impl ShippedPlugin {
    /// The plugin that a node type says to be of, if it is one that comes with gear and is not installed.
    pub(crate) fn absent(of_type: Option<&str>) -> Option<&'static Self> {
        let name = of_type?.strip_suffix(", not installed")?;
        shipped_plugins().iter().find(|plugin| plugin.name == name)
    }

    /// How to have it, in a sentence.
    pub(crate) fn install(&self) -> String {
        let Self { folder, chapter, .. } = self;
        format!("install it as {chapter} says, and name its folder: --plugin {folder}")
    }
}

/// The registry with the nodes of the plugins that come with gear, none of them installed.
pub fn with_shipped(mut registry: Registry) -> Registry {
    for plugin in shipped_plugins() {
        let registered = gear_plugin::register_absent(&mut registry, plugin.name, plugin.nodes, &plugin.install());
        if let Err(error) = registered {
            // A node of a team's own binary may have taken the name; the plugin is then left out.
            tracing::warn!(plugin = plugin.name, %error, "left out");
        }
    }
    registry
}

/// The registry with the nodes of the plugins in these folders, of those in the user's configuration, and of those that
/// come with gear. What is wrong with a folder that was named is a mistake, with a configured one a warning.
pub fn with_plugins(registry: &Registry, named: &[PathBuf], console: &Console) -> Result<Registry, CliError> {
    let mut registry = registry.clone();
    let mut seen = BTreeSet::new();
    for folder in named {
        add(&mut registry, folder, &mut seen).map_err(|cause| CliError::Plugin {
            folder: folder.clone(),
            cause,
        })?;
    }
    for folder in configured(console) {
        if let Err(error) = add(&mut registry, &folder, &mut seen) {
            console.warning(&format!(
                "the configured plugin {} is left out: {error}",
                folder.display()
            ));
        }
    }
    Ok(with_shipped(registry))
}

fn add(registry: &mut Registry, folder: &Path, seen: &mut BTreeSet<PathBuf>) -> Result<(), PluginError> {
    if !seen.insert(folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf())) {
        return Ok(());
    }
    let plugin: Arc<Plugin> = Plugin::open(folder, cache().as_deref())?;
    // All nodes of a plugin, or none.
    let mut with = registry.clone();
    plugin.register(&mut with)?;
    *registry = with;
    Ok(())
}

/// Where descriptions of nodes are kept that a worker was asked for: beside the store.
fn cache() -> Option<PathBuf> {
    Store::default_path().map(|store| store.with_file_name("gear-plugins"))
}

/// The user's `plugins.yaml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Configuration {
    /// Folders; relative ones from the folder of the file.
    plugins: Vec<PathBuf>,
}

/// The folders in the user's configuration.
fn configured(console: &Console) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = std::env::var_os("GEAR_PLUGINS")
        .map(|all| {
            std::env::split_paths(&all)
                .filter(|path| !path.as_os_str().is_empty())
                .collect()
        })
        .unwrap_or_default();
    let Some(path) = configuration_file() else {
        return folders;
    };
    match read(&path) {
        Ok(more) => folders.extend(more),
        Err(cause) => console.warning(&format!("{}: {cause}; its plugins are left out", path.display())),
    }
    folders
}

fn read(path: &Path) -> Result<Vec<PathBuf>, String> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error.to_string()),
    };
    let configuration: Configuration =
        serde_saphyr::from_str(&text).map_err(|error| format!("expected `plugins: [FOLDER, …]`: {error}"))?;
    let base = path.parent().unwrap_or(Path::new("."));
    Ok(configuration
        .plugins
        .into_iter()
        .map(|folder| base.join(folder))
        .collect())
}

fn configuration_file() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let folder = set("XDG_CONFIG_HOME").filter(|path| path.is_absolute()).or_else(|| {
        if cfg!(windows) {
            set("APPDATA")
        } else {
            set("HOME").map(|home| home.join(".config"))
        }
    });
    Some(folder?.join("gear").join("plugins.yaml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_plugin_of_the_repository_comes_with_gear_and_has_its_chapter() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let folders = std::fs::read_dir(root.join("nodes/python")).unwrap();
        let mut found: Vec<_> = folders
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.join(gear_plugin::FILE_NAME).exists())
            .map(|path| format!("nodes/python/{}", path.file_name().unwrap().display()))
            .collect();
        found.sort();
        let known: Vec<_> = shipped_plugins()
            .iter()
            .map(|plugin| plugin.folder.to_owned())
            .collect();
        assert_eq!(found, known);
        for plugin in shipped_plugins() {
            assert!(root.join(plugin.chapter).exists(), "{} is not there", plugin.chapter);
            let opened = Plugin::open(&root.join(plugin.folder), None).unwrap();
            assert_eq!(opened.name(), plugin.name);
        }
    }

    #[test]
    fn all_their_nodes_are_known_and_said_to_be_absent() {
        let registry = with_shipped(crate::registry());
        for name in [
            "Trellis",
            "Lgm",
            "SplatterImage",
            "FluxKontext",
            "FluxKontextViews",
            "GaussianEditor",
        ] {
            let spec = &registry.find_node(name).unwrap().spec;
            assert!(
                spec.plugin.is_some_and(|plugin| plugin.ends_with("not installed")),
                "{name}"
            );
            assert!(ShippedPlugin::absent(spec.plugin).is_some(), "{name}");
            let ports = spec.inputs.iter().chain(&spec.outputs).map(|port| port.doc);
            let docs = ports.chain(spec.params.iter().map(|param| param.doc)).chain([spec.doc]);
            docs.for_each(|doc| assert!(!doc.trim().is_empty(), "{name} says nothing of something"));
        }
    }

    #[test]
    fn folders_of_a_configuration_are_relative_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plugins.yaml");
        assert!(read(&file).unwrap().is_empty(), "no file is no plugins");
        std::fs::write(&file, "plugins: [a, /b]\n").unwrap();
        assert_eq!(read(&file).unwrap(), [folder.path().join("a"), PathBuf::from("/b")]);
        std::fs::write(&file, "plugin: a\n").unwrap();
        assert!(read(&file).unwrap_err().contains("expected `plugins:"));
    }
}
