//! What `run.json` says, as far as it is compared. Whatever a record lacks (one of an older version, or a part that was
//! edited away) is empty, and not a mistake; what is no record at all is one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

/// A run, by its record.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// The folder in which the record stands, with the files of the run.
    pub folder: PathBuf,
    /// The graph file.
    pub graph: String,
    /// How the run ended.
    pub status: String,
    /// Version of the framework.
    pub version: String,
    /// Seconds on the clock.
    pub seconds: f64,
    /// Threads.
    pub jobs: u64,
    /// The folder of its store.
    pub store: Option<PathBuf>,
    /// The nodes and inputs, producers first.
    pub nodes: Vec<NodeRecord>,
    /// The outputs.
    pub outputs: Vec<OutputRecord>,
}

/// A node or input of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeRecord {
    /// Its name.
    pub id: String,
    /// Its type, and what its bits depend on besides parameters: version, numerics, realm.
    pub made_by: String,
    /// What became of it.
    pub status: String,
    /// The file or sample of an input.
    pub source: String,
    /// Its parameters: a map, or null.
    pub params: Value,
    /// Seconds that its computation took, in this run or when it was stored.
    pub seconds: f64,
    /// (key, digest) of every output port.
    pub ports: BTreeMap<String, (String, String)>,
}

/// An output of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OutputRecord {
    /// Its name.
    pub name: String,
    /// The type of its value.
    pub type_name: String,
    /// The digest of its value; empty if it is not there.
    pub digest: String,
}

/// Why a record cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct BadRecord {
    /// The file that was looked for.
    pub path: PathBuf,
    /// What was found and what was expected.
    pub problem: String,
}

impl Record {
    /// Reads the record of a run: `run.json`, or the folder in which it stands.
    pub fn open(path: &Path) -> Result<Self, BadRecord> {
        let file = if path.is_dir() {
            path.join("run.json")
        } else {
            path.to_path_buf()
        };
        let bad = |problem: String| BadRecord {
            path: file.clone(),
            problem,
        };
        let text = std::fs::read(&file).map_err(|e| {
            bad(format!(
                "{e}; expected the output folder of `gear run`, or its run.json"
            ))
        })?;
        let json: Value = serde_json::from_slice(&text).map_err(|e| bad(format!("this is no JSON: {e}")))?;
        if !json["nodes"].is_array() {
            return Err(bad("this is no record of a run: it has no `nodes`".to_owned()));
        }
        let mut record = Self::of(&json);
        record.folder = file.parent().map(Path::to_path_buf).unwrap_or_default();
        Ok(record)
    }

    /// The record that a JSON value is.
    pub fn of(json: &Value) -> Self {
        let list = |key: &str| json[key].as_array().into_iter().flatten();
        Self {
            folder: PathBuf::new(),
            graph: text(&json["graph"]),
            status: text(&json["status"]),
            version: text(&json["version"]),
            seconds: json["seconds"].as_f64().unwrap_or(0.0),
            jobs: json["jobs"].as_u64().unwrap_or(0),
            store: json["store"]["folder"].as_str().map(PathBuf::from),
            nodes: list("nodes").map(node).collect(),
            outputs: list("outputs")
                .map(|output| OutputRecord {
                    name: text(&output["name"]),
                    type_name: text(&output["type"]),
                    digest: text(&output["digest"]),
                })
                .collect(),
        }
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => String::new(),
        other => other.to_string(),
    }
}

fn node(json: &Value) -> NodeRecord {
    let ports = json["outputs"].as_array().into_iter().flatten();
    let numerics = json["numerics"]
        .as_array()
        .into_iter()
        .flatten()
        .map(text)
        .collect::<Vec<_>>();
    NodeRecord {
        id: text(&json["id"]),
        made_by: format!(
            "{} {} {} {}",
            text(&json["type"]),
            text(&json["node_version"]),
            numerics.join(" "),
            text(&json["realm"])
        ),
        status: text(&json["status"]),
        source: text(&json["source"]),
        params: json["params"].clone(),
        seconds: json["seconds"].as_f64().unwrap_or(0.0),
        ports: ports
            .map(|port| (text(&port["port"]), (text(&port["key"]), text(&port["digest"]))))
            .collect(),
    }
}

/// The parameters in which two runs differ, by their places (`method.shading.iterations`), with both values in words. A
/// method that became another is one change; what one of them lacks is empty.
pub fn changes(a: &Value, b: &Value) -> Vec<(String, String, String)> {
    let mut changes = Vec::new();
    differing(String::new(), Some(a), Some(b), &mut changes);
    changes
}

fn differing(at: String, a: Option<&Value>, b: Option<&Value>, changes: &mut Vec<(String, String, String)>) {
    if a == b {
        return;
    }
    let empty = serde_json::Map::new();
    let map = |value: Option<&'_ Value>| match value {
        Some(Value::Object(map)) => Some(map.clone()),
        None | Some(Value::Null) if at.is_empty() => Some(empty.clone()),
        _ => None,
    };
    match (map(a), map(b)) {
        (Some(a), Some(b)) if at.is_empty() || a.keys().any(|key| b.contains_key(key)) => {
            let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for name in names {
                let below = match at.is_empty() {
                    true => name.clone(),
                    false => format!("{at}.{name}"),
                };
                differing(below, a.get(name), b.get(name), changes);
            }
        }
        _ => changes.push((at, a.map(words).unwrap_or_default(), b.map(words).unwrap_or_default())),
    }
}

/// A value as it is written in a graph.
fn words(value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(items) => format!("[{}]", items.iter().map(words).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let fields = fields.iter().map(|(name, value)| format!("{name}: {}", words(value)));
            format!("{{{}}}", fields.collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}
