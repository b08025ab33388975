//! The catalogue as data: named extreme values, cases of single nodes, and what is expected of them.

use std::collections::BTreeMap;

use gear_graph::{AnyValue, Registry};
use serde::Deserialize;
use serde_json::Value as Json;

use super::make::{self, Recipe};

/// The catalogue that comes with gear.
const SHIPPED: &str = include_str!("catalogue.yaml");

/// The version of the format.
const VERSION: u32 = 1;

/// Why a catalogue cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    /// The text is no catalogue.
    #[error("the catalogue cannot be read: {0}")]
    Text(String),
    /// A catalogue of a version to come.
    #[error("the catalogue is of version {found}, this program reads version {VERSION}")]
    Version {
        /// What it says.
        found: u32,
    },
    /// A value that cannot be made.
    #[error("the value `{name}` of the catalogue cannot be made: {cause}")]
    Value {
        /// Its name.
        name: String,
        /// Why.
        cause: String,
    },
    /// A name that nothing has.
    #[error("{place} of the catalogue names {what} `{name}`, which does not exist")]
    Unknown {
        /// Where.
        place: String,
        /// What kind of thing.
        what: &'static str,
        /// The name.
        name: String,
    },
}

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    catalogue: u32,
    ordinary: BTreeMap<String, String>,
    nodes: BTreeMap<String, NodeEntry>,
    values: Vec<ValueEntry>,
    cases: Vec<Case>,
}

/// What is known of a node.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeEntry {
    /// Parameters with which it is tried, where its defaults take long.
    #[serde(default)]
    pub with: serde_json::Map<String, Json>,
    /// Values that it refuses, by input port: names, or `PREFIX*`.
    #[serde(default)]
    pub refuses: BTreeMap<String, Vec<String>>,
    /// How far an output may be from its f64 reference, by output port, as a share of the reference's largest number or
    /// of 1. See [`super::reference`].
    #[serde(default)]
    pub reference: BTreeMap<String, f64>,
    /// Values at which that share is larger, and how large: what is lost is lost in the storage of f32, and the remark
    /// beside it in the file says why.
    #[serde(default)]
    pub looser: BTreeMap<String, f64>,
}

/// A value as the file has it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ValueEntry {
    name: String,
    why: String,
    make: Recipe,
}

/// A named extreme value.
#[derive(Clone, Debug)]
pub struct Named {
    /// Its name, `image/black`.
    pub name: String,
    /// What makes it extreme.
    pub why: String,
    /// The value.
    pub value: AnyValue,
}

/// A node with its parameters, on given values, and what is expected of it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// A name that says what is extreme.
    pub name: String,
    /// The node type.
    pub node: String,
    /// Its parameters.
    #[serde(default)]
    pub with: serde_json::Map<String, Json>,
    /// Parameters that are NaN: which the check of a graph must refuse.
    #[serde(default)]
    pub nan: Vec<String>,
    /// The values at its input ports, by name, made to go with the first; ports that are not named are left out.
    #[serde(default, rename = "in")]
    pub inputs: BTreeMap<String, String>,
    /// What is expected.
    pub expect: Expect,
}

/// What is expected of a case.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// The node or its parameters are refused, with a message that holds this text.
    #[serde(default)]
    pub refused: Option<String>,
    /// What holds of outputs, by port.
    #[serde(default)]
    pub outputs: BTreeMap<String, Holds>,
}

/// What holds of an output.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Holds {
    /// Its finite numbers lie between these two.
    #[serde(default)]
    pub range: Option<[f64; 2]>,
    /// It is the value at this input port.
    #[serde(default)]
    pub same_as: Option<String>,
    /// How far `range` and `same_as` may be missed.
    #[serde(default)]
    pub within: f64,
}

/// A catalogue whose values are made.
#[derive(Clone, Debug)]
pub struct Catalogue {
    /// What the inputs are that are not extreme, by type.
    pub ordinary: BTreeMap<String, AnyValue>,
    /// What is known of nodes, by type.
    pub nodes: BTreeMap<String, NodeEntry>,
    /// The extreme values.
    pub values: Vec<Named>,
    /// The cases.
    pub cases: Vec<Case>,
}

impl Catalogue {
    /// The catalogue that comes with gear, and the extremes that the types of a registry declare beyond it.
    pub fn shipped(registry: &Registry) -> Result<Self, CatalogueError> {
        Self::read(SHIPPED, registry)
    }

    /// Reads a catalogue and makes its values.
    pub fn read(text: &str, registry: &Registry) -> Result<Self, CatalogueError> {
        let file: File = serde_saphyr::from_str(text).map_err(|e| CatalogueError::Text(e.to_string()))?;
        if file.catalogue != VERSION {
            return Err(CatalogueError::Version { found: file.catalogue });
        }
        let mut values = Vec::new();
        for entry in file.values {
            let made = make::value(&entry.make, registry);
            let value = made.map_err(|cause| CatalogueError::Value {
                name: entry.name.clone(),
                cause,
            })?;
            values.push(Named {
                name: entry.name,
                why: entry.why,
                value,
            });
        }
        let known: Vec<_> = values.iter().map(|named: &Named| named.value.digest()).collect();
        for value_type in registry.values() {
            for (name, value) in value_type.extremes() {
                if !known.contains(&value.digest()) {
                    values.push(Named {
                        name: format!("{}/{name}", value_type.name.to_lowercase()),
                        why: "declared by its type".to_owned(),
                        value,
                    });
                }
            }
        }
        let mut catalogue = Self {
            ordinary: BTreeMap::new(),
            nodes: file.nodes,
            values,
            cases: file.cases,
        };
        for (type_name, name) in file.ordinary {
            let value = catalogue.find(&name).map(|named| named.value.clone());
            let value = value.ok_or_else(|| unknown("`ordinary`", "a value", &name))?;
            catalogue.ordinary.insert(type_name, value);
        }
        // Of types that the catalogue does not know, the first extreme without a flaw is ordinary enough.
        for value_type in registry.values() {
            if !catalogue.ordinary.contains_key(value_type.name)
                && let Some((_, value)) = value_type.extremes().into_iter().find(|(_, v)| v.flaw().is_none())
            {
                catalogue.ordinary.insert(value_type.name.to_owned(), value);
            }
        }
        catalogue.check()?;
        Ok(catalogue)
    }

    /// The value of that name.
    pub fn find(&self, name: &str) -> Option<&Named> {
        self.values.iter().find(|named| named.name == name)
    }

    /// Every name that is used exists.
    fn check(&self) -> Result<(), CatalogueError> {
        for case in &self.cases {
            let lost = case.inputs.values().find(|name| self.find(name).is_none());
            if let Some(name) = lost {
                return Err(unknown(&format!("the case `{}`", case.name), "a value", name));
            }
        }
        for (node, entry) in &self.nodes {
            let refused = entry.refuses.values().flatten().chain(entry.looser.keys());
            let lost = |pattern: &&String| !self.values.iter().any(|named| fits(pattern, &named.name));
            if let Some(name) = refused.into_iter().find(lost) {
                return Err(unknown(&format!("the node `{node}`"), "a value", name));
            }
        }
        Ok(())
    }
}

impl NodeEntry {
    /// Whether it refuses a value at a port.
    pub fn refuses(&self, port: &str, value: &str) -> bool {
        let patterns = self.refuses.get(port).into_iter().flatten();
        patterns.into_iter().any(|pattern| fits(pattern, value))
    }

    /// How far an output may be from its reference when this value is at an input.
    pub fn tolerance(&self, output: &str, value: &str) -> Option<f64> {
        let tolerance = *self.reference.get(output)?;
        let looser = self.looser.iter().find(|(pattern, _)| fits(pattern, value));
        Some(looser.map_or(tolerance, |(_, looser)| tolerance.max(*looser)))
    }
}

/// Whether a name is what a pattern means: the name itself, or with `*` at its end all that begin so.
fn fits(pattern: &str, name: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(prefix) => name.starts_with(prefix),
        None => pattern == name,
    }
}

fn unknown(place: &str, what: &'static str, name: &str) -> CatalogueError {
    CatalogueError::Unknown {
        place: place.to_owned(),
        what,
        name: name.to_owned(),
    }
}
