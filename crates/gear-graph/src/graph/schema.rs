//! The JSON Schema of graph files (draft 2020-12), made from the specifications of the nodes and loaders.
//!
//! Editors complete and explain names with it while one writes. It says less than the check: what the names of a graph
//! refer to, and which types meet at a wire, is beyond a schema. A file that extends another may leave out what is
//! required, and say `null`, so everything is there twice.

use serde_json::{Map, Value, json};

use super::GRAPH_VERSION;
use super::file::{LONGEST_NAME, RESERVED};
use super::snapshots::{NORM, Norm, SIZE, SIZES, TOLERANCE};
use crate::{Limits, LoaderSpec, NodeSpec, ParamKind, ParamSpec, PortSpec, Registry};

/// The JSON Schema of the graph files that the registry's nodes, values and loaders allow.
pub fn schema(registry: &Registry) -> Value {
    let mut defs = Map::new();
    let name = format!("^\\p{{Alphabetic}}[\\p{{Alphabetic}}0-9_-]{{0,{}}}$", LONGEST_NAME - 1);
    let source = format!("{}(\\.[A-Za-z_][A-Za-z0-9_]*)?$", name.trim_end_matches('$'));
    defs.insert("name".into(), json!({"type": "string", "pattern": name}));
    defs.insert(
        "source".into(),
        json!({
            "description": "The name of an input, or `node.port`.",
            "type": "string",
            "pattern": source,
        }),
    );
    let types: Vec<_> = registry.values().map(|value_type| value_type.name).collect();
    defs.insert(
        "type".into(),
        json!({"description": "The type of a value.", "enum": types}),
    );
    let node_types: Vec<_> = registry
        .nodes()
        .map(|node| json!({"const": node.spec.name, "description": node.spec.doc}))
        .collect();
    defs.insert("node-type".into(), json!({"anyOf": node_types}));
    for overlay in [false, true] {
        for node in registry.nodes() {
            defs.insert(key("node", node.spec.name, overlay), node_parts(&node.spec, overlay));
        }
        for loader in registry.loaders() {
            let name = loader.spec.value_type.name;
            defs.insert(key("input", name, overlay), input_parts(&loader.spec, overlay));
        }
        defs.insert(key("any", "node", overlay), node(registry, overlay));
        defs.insert(key("any", "input", overlay), input(registry, overlay));
        defs.insert(key("any", "snapshot", overlay), snapshot(overlay));
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A graph of gear",
        "description": "Inputs, nodes and outputs of a dataflow graph.",
        "type": "object",
        "properties": {
            "gear": {"description": "The version of the format.", "const": GRAPH_VERSION, "default": GRAPH_VERSION},
            "extends": {
                "description": "The graph that this one changes: a path from the folder of this file, or `@name`.",
                "type": "string",
            },
            "inputs": {"description": "What a run is given, by name."},
            "nodes": {"description": "What is computed, by name."},
            "outputs": {"description": "What a run gives: `node.port`, or the name of an input."},
            "snapshots": {"description": "The ports that `gear snap` pins, and how far they may move."},
        },
        "required": ["gear"],
        "additionalProperties": false,
        "if": {"required": ["extends"]},
        "then": {"properties": sections(true)},
        "else": {"properties": sections(false), "required": ["outputs"]},
        "$defs": defs,
    })
}

/// The name of a definition.
fn key(what: &str, name: &str, overlay: bool) -> String {
    let over = if overlay { "overlay-" } else { "" };
    format!("{over}{what}-{name}")
}

fn reference(what: &str, name: &str, overlay: bool) -> Value {
    json!({"$ref": format!("#/$defs/{}", key(what, name, overlay))})
}

/// In a graph over another, `null` removes what stands there.
fn or_null(schema: Value, overlay: bool) -> Value {
    if overlay {
        json!({"anyOf": [schema, {"type": "null", "description": "Removes it."}]})
    } else {
        schema
    }
}

fn sections(overlay: bool) -> Value {
    let section = |of: Value| {
        json!({
            "type": ["object", "null"],
            "propertyNames": {"$ref": "#/$defs/name"},
            "additionalProperties": or_null(of, overlay),
        })
    };
    let mut outputs = section(json!({"$ref": "#/$defs/source"}));
    let reserved: Vec<_> = RESERVED.iter().map(|name| any_case(name)).collect();
    outputs["propertyNames"] = json!({
        "allOf": [{"$ref": "#/$defs/name"}, {"not": {"pattern": format!("^({})$", reserved.join("|"))}}],
    });
    if !overlay {
        outputs["type"] = json!("object");
        outputs["minProperties"] = json!(1);
    }
    json!({
        "inputs": section(reference("any", "input", overlay)),
        "nodes": section(reference("any", "node", overlay)),
        "outputs": outputs,
        "snapshots": section(reference("any", "snapshot", overlay)),
    })
}

/// A snapshot: a port, or a map with one.
fn snapshot(overlay: bool) -> Value {
    let norms: Vec<_> = Norm::ALL
        .into_iter()
        .map(|n| json!({"const": n.name(), "description": n.doc()}))
        .collect();
    let mut map = json!({
        "type": "object",
        "properties": {
            "port": {"description": "The port that is pinned.", "$ref": "#/$defs/source"},
            "norm": {"description": "How the distance is measured.", "anyOf": norms, "default": NORM.name()},
            "tolerance": {"description": "How far it may move.", "type": "number", "minimum": 0, "default": TOLERANCE},
            "size": {
                "description": "Longer side of the picture that is kept, in pixels.",
                "type": "integer", "minimum": SIZES.0, "maximum": SIZES.1, "default": SIZE,
            },
        },
        "additionalProperties": false,
    });
    if !overlay {
        map["required"] = json!(["port"]);
    }
    json!({"anyOf": [{"$ref": "#/$defs/source"}, map]})
}

/// A pattern for a word in capitals or not.
fn any_case(word: &str) -> String {
    let both = |c: char| format!("[{}{}]", c.to_ascii_uppercase(), c.to_ascii_lowercase());
    word.chars().map(both).collect()
}

/// Any node: its type decides what `in` and `with` are.
fn node(registry: &Registry, overlay: bool) -> Value {
    let parts: Vec<_> = registry
        .nodes()
        .map(|node| {
            json!({
                "if": {"properties": {"node": {"const": node.spec.name}}, "required": ["node"]},
                "then": reference("node", node.spec.name, overlay),
            })
        })
        .collect();
    let mut schema = json!({
        "type": "object",
        "properties": {
            "node": {"description": "The type of the node.", "$ref": "#/$defs/node-type"},
            "in": {"description": "What is wired to the input ports.", "type": ["object", "null"]},
            "with": {"description": "The parameters.", "type": ["object", "null"]},
        },
        "additionalProperties": false,
        "allOf": parts,
    });
    if !overlay {
        schema["required"] = json!(["node"]);
    }
    schema
}

/// `in` and `with` of one type of node.
fn node_parts(spec: &NodeSpec, overlay: bool) -> Value {
    let ports: Map<_, _> = spec
        .inputs
        .iter()
        .map(|input| (input.name.to_owned(), or_null(port(input), overlay)))
        .collect();
    let needed: Vec<_> = spec
        .inputs
        .iter()
        .filter(|input| !input.optional && !overlay)
        .map(|input| input.name)
        .collect();
    let mut wires = json!({
        "type": if needed.is_empty() { json!(["object", "null"]) } else { json!("object") },
        "properties": ports,
        // An overlay that puts another type of node in a place takes away the wires that this one has no port for.
        "additionalProperties": if overlay { json!({"type": "null"}) } else { json!(false) },
    });
    let mut schema = json!({});
    let mut required = Vec::new();
    if !needed.is_empty() {
        required.push("in");
        wires["required"] = json!(needed);
    }
    let with = params(&spec.params, overlay);
    if with.get("required").is_some() {
        required.push("with");
    }
    schema["properties"] = json!({"in": wires, "with": with});
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

fn port(spec: &PortSpec) -> Value {
    let one = json!({"$ref": "#/$defs/source"});
    let many = if spec.many { ", any number" } else { "" };
    let description = format!("{}{many}. {}", spec.value_type.name, spec.doc);
    if spec.many {
        json!({"description": description, "anyOf": [one, {"type": "array", "items": one}]})
    } else {
        json!({"description": description, "$ref": "#/$defs/source"})
    }
}

/// Any input: a type, or a map with one.
fn input(registry: &Registry, overlay: bool) -> Value {
    let parts: Vec<_> = registry
        .values()
        .map(|value_type| {
            let name = value_type.name;
            let with = match registry.find_loader(name) {
                Some(_) => reference("input", name, overlay),
                None => json!({"properties": {"with": {"type": ["object", "null"], "maxProperties": 0}}}),
            };
            json!({"if": {"properties": {"type": {"const": name}}, "required": ["type"]}, "then": with})
        })
        .collect();
    let mut map = json!({
        "type": "object",
        "properties": {
            "type": {"$ref": "#/$defs/type"},
            "optional": {"description": "Whether a run may go without it.", "type": "boolean", "default": false},
            "with": {"description": "The parameters of the loader.", "type": ["object", "null"]},
        },
        "additionalProperties": false,
        "allOf": parts,
    });
    if !overlay {
        map["required"] = json!(["type"]);
    }
    json!({"anyOf": [{"$ref": "#/$defs/type"}, map]})
}

/// `with` of one type of input.
fn input_parts(spec: &LoaderSpec, overlay: bool) -> Value {
    let with = params(&spec.params, overlay);
    if with.get("required").is_some() {
        json!({"properties": {"with": with}, "required": ["with"]})
    } else {
        json!({"properties": {"with": with}})
    }
}

/// A map of parameters.
fn params(specs: &[ParamSpec], overlay: bool) -> Value {
    let properties: Map<_, _> = specs
        .iter()
        .map(|spec| (spec.name.to_owned(), param(spec, overlay)))
        .collect();
    let required: Vec<_> = specs
        .iter()
        .filter(|spec| spec.default.is_none() && !overlay)
        .map(|spec| spec.name)
        .collect();
    let mut schema = json!({
        "type": if required.is_empty() { json!(["object", "null"]) } else { json!("object") },
        "properties": properties,
        "additionalProperties": false,
    });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

fn param(spec: &ParamSpec, overlay: bool) -> Value {
    let mut description = spec.doc.to_owned();
    let takes = spec.kind.describe();
    let limits = spec.limits.to_string();
    let range = if spec.limits == Limits::none() {
        String::new()
    } else {
        format!(", {limits}")
    };
    description.push_str(&format!("\n\nTakes {takes}{range}."));
    let mut schema = or_null(kind(&spec.kind, &spec.limits, overlay), overlay);
    if let Some(default) = &spec.default {
        description.push_str(&format!(" Default: {default}."));
        schema["default"] = default.clone();
    }
    schema["description"] = json!(description);
    schema
}

fn kind(kind: &ParamKind, limits: &Limits, overlay: bool) -> Value {
    match kind {
        ParamKind::Bool => json!({"type": "boolean"}),
        ParamKind::Integer => number("integer", limits),
        ParamKind::Number => number("number", limits),
        ParamKind::Text => json!({"type": "string"}),
        ParamKind::Choice { variants } => {
            let mut forms = Vec::new();
            for variant in variants {
                let with = params(&variant.params, overlay);
                if with.get("required").is_none() {
                    forms.push(json!({"const": variant.name, "description": variant.doc}));
                }
                let mut with = with;
                with["description"] = json!(variant.doc);
                forms.push(json!({
                    "type": "object",
                    "properties": {variant.name: with},
                    "required": [variant.name],
                    "additionalProperties": false,
                }));
            }
            json!({"anyOf": forms})
        }
        ParamKind::List { of, len } => {
            let mut list = json!({"type": "array", "items": self::kind(of, limits, overlay)});
            if let Some(len) = len {
                list["minItems"] = json!(len);
                list["maxItems"] = json!(len);
            }
            list
        }
        ParamKind::OrAuto { of } => json!({
            "anyOf": [{"const": "auto", "description": "The node finds the value itself."}, self::kind(of, limits, overlay)],
        }),
        ParamKind::Optional { of } => json!({"anyOf": [self::kind(of, limits, overlay), {"type": "null"}]}),
    }
}

fn number(name: &str, limits: &Limits) -> Value {
    let mut schema = json!({"type": name});
    for (bound, closed, open) in [
        (limits.min, "minimum", "exclusiveMinimum"),
        (limits.max, "maximum", "exclusiveMaximum"),
    ] {
        let Some(bound) = bound else { continue };
        let whole = bound.value as i64;
        let value = if whole as f64 == bound.value {
            json!(whole)
        } else {
            json!(bound.value)
        };
        schema[if bound.inclusive { closed } else { open }] = value;
    }
    schema
}
