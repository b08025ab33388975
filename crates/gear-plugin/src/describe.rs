//! Nodes as a plugin describes them, in JSON, and as the framework wants them.
//!
//! The same form stands in the answer to the handshake and in the file that `nodes:` of a `plugin.yaml` names. It is
//! close to what `gear nodes` shows; docs/design/plugins.md has it in full.

use gear_graph::{Bound, Limits, NodeSpec, ParamKind, ParamSpec, ParamValue, PortSpec, Registry, Variant, interned};
use serde::{Deserialize, Deserializer, Serialize};

/// The version of [`NodesFile`].
const FORMAT: u32 = 1;

/// More nodes than this no plugin has.
const MOST_NODES: usize = 64;

/// More parameters than this no node or method has.
const MOST_PARAMS: usize = 256;

/// Kinds within kinds, and methods within methods.
const DEEPEST: usize = 16;

/// The file that `nodes:` names: descriptions that need no worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct NodesFile {
    /// The version of this format: 1.
    pub gear_plugin_nodes: u32,
    /// The nodes.
    pub nodes: Vec<NodeDescription>,
}

impl NodesFile {
    /// These nodes, in the present format.
    pub fn new(nodes: Vec<NodeDescription>) -> Self {
        Self {
            gear_plugin_nodes: FORMAT,
            nodes,
        }
    }

    /// Reads the file.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if file.gear_plugin_nodes != FORMAT {
            return Err(format!(
                "`gear-plugin-nodes: {}` is another version of the format; this gear knows {FORMAT}",
                file.gear_plugin_nodes
            ));
        }
        Ok(file)
    }
}

/// A node type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeDescription {
    /// The name in graph files, such as `Blur`.
    pub name: String,
    /// Raised when results change.
    #[serde(default = "one")]
    pub version: u32,
    /// What it does; the first line is its summary.
    #[serde(default)]
    pub doc: String,
    /// Whether equal inputs give equal bits.
    #[serde(default = "yes")]
    pub deterministic: bool,
    /// Input ports.
    #[serde(default)]
    pub inputs: Vec<PortDescription>,
    /// Output ports.
    pub outputs: Vec<PortDescription>,
    /// Parameters.
    #[serde(default)]
    pub params: Vec<ParamDescription>,
}

/// A port.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PortDescription {
    /// The name in graph files.
    pub name: String,
    /// The type of its values, such as `Image`.
    #[serde(rename = "type")]
    pub value_type: String,
    /// What it holds.
    #[serde(default)]
    pub doc: String,
    /// An input that need not be wired.
    #[serde(default)]
    pub optional: bool,
    /// An input that takes a list of any length.
    #[serde(default)]
    pub many: bool,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParamDescription {
    /// The name in graph files.
    pub name: String,
    /// What it does.
    #[serde(default)]
    pub doc: String,
    /// What it takes.
    pub kind: KindDescription,
    /// Its range.
    #[serde(default, skip_serializing_if = "is_default")]
    pub range: Bounds,
    /// Its unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The value when it is not given; left out if it must be given.
    #[serde(default, deserialize_with = "given", skip_serializing_if = "Option::is_none")]
    pub default: Option<ParamValue>,
}

/// The ends of a range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bounds {
    /// At least this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// At most this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// Above this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
    /// Below this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below: Option<f64>,
}

/// What a parameter takes: a word, or a map of one word to what it holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KindDescription {
    /// `true` or `false`.
    Bool,
    /// A whole number.
    Integer,
    /// A finite number.
    Number,
    /// A text.
    Text,
    /// One of these.
    Choice(Vec<VariantDescription>),
    /// A list.
    List {
        /// What its elements are.
        of: Box<KindDescription>,
        /// How many, if that is fixed.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        len: Option<usize>,
    },
    /// The word `auto`, or a value.
    OrAuto(Box<KindDescription>),
    /// `null`, or a value.
    Optional(Box<KindDescription>),
}

/// One choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantDescription {
    /// The word.
    pub name: String,
    /// What it stands for.
    #[serde(default)]
    pub doc: String,
    /// Parameters of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub params: Vec<ParamDescription>,
}

fn one() -> u32 {
    1
}

fn yes() -> bool {
    true
}

fn is_default(bounds: &Bounds) -> bool {
    *bounds == Bounds::default()
}

/// A default that is `null` is a default.
fn given<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<ParamValue>, D::Error> {
    ParamValue::deserialize(deserializer).map(Some)
}

/// The specifications of these nodes, with the value types of `registry`.
pub(crate) fn specs(plugin: &str, nodes: &[NodeDescription], registry: &Registry) -> Result<Vec<NodeSpec>, String> {
    if nodes.is_empty() || nodes.len() > MOST_NODES {
        return Err(format!("describes {} nodes; expected 1 to {MOST_NODES}", nodes.len()));
    }
    nodes.iter().map(|node| spec(plugin, node, registry)).collect()
}

fn spec(plugin: &str, node: &NodeDescription, registry: &Registry) -> Result<NodeSpec, String> {
    let ports = |ports: &[PortDescription]| -> Result<Vec<PortSpec>, String> {
        ports.iter().map(|port| port_spec(&node.name, port, registry)).collect()
    };
    let (inputs, outputs) = (ports(&node.inputs)?, ports(&node.outputs)?);
    if let Some(odd) = outputs.iter().find(|port| port.optional || port.many) {
        return Err(format!(
            "output `{}` of `{}` cannot be optional or many: only inputs can",
            odd.name, node.name
        ));
    }
    Ok(NodeSpec {
        name: interned(&node.name),
        version: node.version,
        doc: interned(&node.doc),
        deterministic: node.deterministic,
        kept: node.deterministic,
        numerics: Vec::new(),
        inputs,
        // Which of several is wanted is told to the worker.
        outputs: outputs
            .into_iter()
            .map(|port| PortSpec { lazy: true, ..port })
            .collect(),
        params: param_specs(&node.name, &node.params, 0)?,
        plugin: Some(interned(plugin)),
    })
}

fn port_spec(node: &str, port: &PortDescription, registry: &Registry) -> Result<PortSpec, String> {
    let Some(value_type) = registry.find_value(&port.value_type) else {
        let types: Vec<_> = registry.values().map(|value| value.name).collect();
        return Err(format!(
            "port `{}` of `{node}` has the type `{}`; the types are {}",
            port.name,
            port.value_type,
            types.join(", ")
        ));
    };
    Ok(PortSpec {
        name: interned(&port.name),
        doc: interned(&port.doc),
        value_type,
        optional: port.optional || port.many,
        lazy: false,
        many: port.many,
    })
}

fn param_specs(node: &str, params: &[ParamDescription], depth: usize) -> Result<Vec<ParamSpec>, String> {
    if params.len() > MOST_PARAMS {
        return Err(format!(
            "`{node}` has {} parameters; expected at most {MOST_PARAMS}",
            params.len()
        ));
    }
    let spec = |param: &ParamDescription| {
        Ok(ParamSpec {
            name: interned(&param.name),
            doc: interned(&param.doc),
            kind: kind(node, &param.kind, depth)?,
            limits: limits(&param.range, param.unit.as_deref())
                .map_err(|cause| format!("parameter `{}` of `{node}`: {cause}", param.name))?,
            default: param.default.clone(),
        })
    };
    params.iter().map(spec).collect()
}

fn kind(node: &str, described: &KindDescription, depth: usize) -> Result<ParamKind, String> {
    if depth > DEEPEST {
        return Err(format!("a parameter of `{node}` is nested more than {DEEPEST} deep"));
    }
    let inner = |of: &KindDescription| kind(node, of, depth + 1).map(Box::new);
    Ok(match described {
        KindDescription::Bool => ParamKind::Bool,
        KindDescription::Integer => ParamKind::Integer,
        KindDescription::Number => ParamKind::Number,
        KindDescription::Text => ParamKind::Text,
        KindDescription::Choice(variants) => ParamKind::Choice {
            variants: variants
                .iter()
                .map(|variant| {
                    Ok(Variant {
                        name: interned(&variant.name),
                        doc: interned(&variant.doc),
                        params: param_specs(node, &variant.params, depth + 1)?,
                    })
                })
                .collect::<Result<_, String>>()?,
        },
        KindDescription::List { of, len } => ParamKind::List {
            of: inner(of)?,
            len: *len,
        },
        KindDescription::OrAuto(of) => ParamKind::OrAuto { of: inner(of)? },
        KindDescription::Optional(of) => ParamKind::Optional { of: inner(of)? },
    })
}

fn limits(range: &Bounds, unit: Option<&str>) -> Result<Limits, String> {
    let end = |closed: Option<f64>, open: Option<f64>| match (closed, open) {
        (Some(_), Some(_)) => Err("a range has one lower and one upper end".to_owned()),
        (Some(value), None) => Ok(Some(Bound { value, inclusive: true })),
        (None, Some(value)) => Ok(Some(Bound {
            value,
            inclusive: false,
        })),
        (None, None) => Ok(None),
    };
    Ok(Limits {
        min: end(range.min, range.above)?,
        max: end(range.max, range.below)?,
        unit: unit.map(interned),
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn described(node: serde_json::Value) -> Result<NodeSpec, String> {
        let mut registry = Registry::new();
        gear_image::register(&mut registry);
        let node: NodeDescription = serde_json::from_value(node).map_err(|error| error.to_string())?;
        specs("test", &[node], &registry).map(|mut specs| specs.remove(0))
    }

    #[test]
    fn everything_a_rust_node_can_say_a_plugin_can_say() {
        let spec = described(json!({
            "name": "Blur", "version": 3, "doc": "Blurs.\n\nMore.", "deterministic": false,
            "inputs": [{"name": "image", "type": "Image", "doc": "It."}, {"name": "mask", "type": "Mask", "optional": true}],
            "outputs": [{"name": "image", "type": "Image"}],
            "params": [
                {"name": "radius", "kind": "number", "range": {"above": 0, "max": 9}, "unit": "px", "default": 2, "doc": "R."},
                {"name": "size", "kind": {"optional": "integer"}, "default": null},
                {"name": "box", "kind": {"list": {"of": "number", "len": 4}}},
                {"name": "beta", "kind": {"or-auto": "number"}, "default": "auto"},
                {"name": "method", "kind": {"choice": [
                    {"name": "plain", "doc": "P."},
                    {"name": "soft", "params": [{"name": "knee", "kind": "number", "default": 0.5}]}
                ]}, "default": "plain"},
            ],
        }))
        .unwrap();
        assert_eq!((spec.name, spec.version, spec.plugin), ("Blur", 3, Some("test")));
        assert!(spec.inputs[1].optional && !spec.deterministic);
        assert_eq!(spec.params[0].limits.to_string(), "above 0 and at most 9 (px)");
        assert_eq!(spec.params[1].default, Some(json!(null)), "null is a default");
        assert_eq!(spec.params[2].default, None, "what has no default must be given");
        assert_eq!(spec.params[4].kind.describe(), "one of plain, soft");
    }

    #[test]
    fn a_description_survives_its_file() {
        let text = r#"{"gear-plugin-nodes": 1, "nodes": [{"name": "A", "outputs": [{"name": "x", "type": "Image"}],
            "params": [{"name": "p", "kind": {"optional": "text"}, "default": null}, {"name": "q", "kind": "bool"}]}]}"#;
        let file = NodesFile::parse(text).unwrap();
        let again = NodesFile::parse(&serde_json::to_string(&file).unwrap()).unwrap();
        assert_eq!(file, again);
    }

    #[test]
    fn what_cannot_be_is_told() {
        let refused = |node| described(node).unwrap_err();
        assert!(refused(json!({"name": "A", "outputs": [{"name": "x", "type": "Imagine"}]})).contains("the types are"));
        assert!(refused(json!({"name": "A", "outputs": [], "colour": 1})).contains("colour"));
        assert!(
            refused(json!({"name": "A", "outputs": [{"name": "x", "type": "Image", "many": true}]}))
                .contains("only inputs can")
        );
        let mut deep = json!("number");
        for _ in 0..40 {
            deep = json!({"optional": deep});
        }
        let param = json!({"name": "p", "kind": deep});
        assert!(
            refused(json!({"name": "A", "outputs": [{"name": "x", "type": "Image"}], "params": [param]}))
                .contains("deep")
        );
    }
}
