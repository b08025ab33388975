//! `gear nodes`: what nodes there are, and everything about one, from its definition.

pub mod markdown;

use std::fmt::Write;

use gear_graph::graph::nearest;
use gear_graph::{Limits, LoaderSpec, NodeSpec, ParamKind, ParamSpec, PortSpec, Registry};

use crate::args::NodesArgs;
use crate::console::Console;
use crate::error::{CliError, Exit};

pub fn nodes(args: &NodesArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let Some(name) = &args.name else {
        let text = if args.markdown {
            markdown::reference(registry)
        } else {
            list(registry)
        };
        console.result(text.trim_end());
        return Ok(Exit::Done);
    };
    if let Some(loader) = registry.find_loader(name) {
        let text = if args.markdown {
            markdown::loader(&loader.spec, 1)
        } else {
            describe_loader(&loader.spec)
        };
        console.result(text.trim_end());
        return Ok(Exit::Done);
    }
    let Some(node) = registry.find_node(name) else {
        let inputs = registry.loaders().map(|loader| loader.spec.value_type.name);
        let names: Vec<_> = registry.nodes().map(|node| node.spec.name).chain(inputs).collect();
        let help = match nearest(name, names.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("there are {}", names.join(", ")),
        };
        return Err(CliError::UnknownNode {
            name: name.clone(),
            help,
        });
    };
    let text = if args.markdown {
        markdown::node(&node.spec, 1)
    } else {
        describe(&node.spec)
    };
    console.result(text.trim_end());
    Ok(Exit::Done)
}

fn list(registry: &Registry) -> String {
    let width = registry.nodes().map(|node| node.spec.name.len()).max().unwrap_or(0);
    let mut text = String::new();
    for node in registry.nodes() {
        let mut remark = String::new();
        if !node.spec.deterministic {
            remark.push_str("  (not deterministic)");
        }
        if let Some(plugin) = node.spec.plugin {
            let _ = write!(remark, "  (plugin {plugin})");
        }
        let _ = writeln!(text, "{:<width$}  {}{remark}", node.spec.name, summary(node.spec.doc));
    }
    let _ = writeln!(text, "\ninputs that can be given as files:");
    for loader in registry.loaders() {
        let _ = writeln!(
            text,
            "{:<width$}  {}",
            loader.spec.value_type.name,
            summary(loader.spec.doc)
        );
    }
    text
}

/// What is said of a node that cannot promise the same bits.
pub(super) fn not_deterministic(spec: &NodeSpec) -> Option<&'static str> {
    match (spec.deterministic, spec.kept) {
        (true, _) => None,
        (false, true) => Some(
            "Not deterministic: equal inputs may give other bits. Its results are kept all the same; --fresh asks again.",
        ),
        (false, false) => Some(
            "Not deterministic: equal inputs may give other bits. Its results are kept only with --cache-nondeterministic.",
        ),
    }
}

fn describe(spec: &NodeSpec) -> String {
    let mut text = format!("{}, version {}\n\n", spec.name, spec.version);
    for line in spec.doc.trim().lines() {
        let _ = writeln!(text, "  {}", line.trim());
    }
    if let Some(plugin) = spec.plugin {
        let _ = writeln!(
            text,
            "
  A node of the plugin {plugin}."
        );
    }
    if let Some(remark) = not_deterministic(spec) {
        let _ = writeln!(
            text,
            "
  {remark}"
        );
    }
    ports(&mut text, "inputs", &spec.inputs, true);
    ports(&mut text, "outputs", &spec.outputs, false);
    if !spec.params.is_empty() {
        text.push_str("\nparameters\n");
        params(&mut text, &spec.params, 2);
    }
    text
}

/// What a graph may say about an input of this type, under `with`.
fn describe_loader(spec: &LoaderSpec) -> String {
    let name = spec.value_type.name;
    let mut text = format!(
        "{name}, an input that can be given as a file, version {}\n\n",
        spec.version
    );
    paragraph(&mut text, spec.doc, 2);
    if !spec.params.is_empty() {
        text.push_str("\nparameters, in a graph `NAME: {type: ");
        let _ = writeln!(
            text,
            "{name}, with: {{…}}}}`, on the command line `--set NAME.PARAM=VALUE`"
        );
        params(&mut text, &spec.params, 2);
    }
    text
}

fn ports(text: &mut String, title: &str, ports: &[PortSpec], inputs: bool) {
    let _ = writeln!(text, "\n{title}");
    let width = ports.iter().map(|port| port.name.len()).max().unwrap_or(0);
    for port in ports {
        let mut remarks = Vec::new();
        if port.optional {
            remarks.push("optional");
        }
        if port.lazy {
            remarks.push(if inputs {
                "computed only if needed"
            } else {
                "computed only if read"
            });
        }
        let remarks = if remarks.is_empty() {
            String::new()
        } else {
            format!("  ({})", remarks.join(", "))
        };
        let _ = writeln!(text, "  {:<width$}  {}{remarks}", port.name, port.value_type.name);
        paragraph(text, port.doc, 6);
    }
}

fn params(text: &mut String, specs: &[ParamSpec], indent: usize) {
    for param in specs {
        let mut facts = vec![param.kind.describe()];
        if param.limits != Limits::default() {
            facts.push(param.limits.to_string());
        }
        match &param.default {
            Some(default) => facts.push(format!("default {}", yaml(default))),
            None => facts.push("must be given".to_owned()),
        }
        let _ = writeln!(text, "{:indent$}{}: {}", "", param.name, facts.join("; "));
        paragraph(text, param.doc, indent + 4);
        methods(text, &param.kind, indent + 4);
    }
}

/// The methods of a choice that have parameters of their own, or words of explanation.
fn methods(text: &mut String, kind: &ParamKind, indent: usize) {
    let ParamKind::Choice { variants } = kind else {
        return;
    };
    for variant in variants {
        let _ = writeln!(text, "{:indent$}{}", "", variant.name);
        paragraph(text, variant.doc, indent + 4);
        params(text, &variant.params, indent + 4);
    }
}

/// A value as one types it after `--set NODE.PARAM=`, or in a graph file: YAML in one line.
fn yaml(value: &serde_json::Value) -> String {
    use serde_json::Value;
    match value {
        Value::String(word) if plain(word) => word.clone(),
        Value::Array(items) => format!("[{}]", items.iter().map(yaml).collect::<Vec<_>>().join(", ")),
        Value::Object(items) => {
            let items: Vec<_> = items
                .iter()
                .map(|(name, item)| format!("{name}: {}", yaml(item)))
                .collect();
            format!("{{{}}}", items.join(", "))
        }
        // Numbers, booleans, null and quoted texts are written alike in JSON and YAML.
        other => other.to_string(),
    }
}

/// Whether a text needs no quotes: a word that no YAML reader takes for anything else.
fn plain(word: &str) -> bool {
    let reserved = ["true", "false", "null", "yes", "no", "on", "off", "y", "n"];
    word.starts_with(|c: char| c.is_ascii_alphabetic())
        && word.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c))
        && !reserved.contains(&word.to_ascii_lowercase().as_str())
}

fn paragraph(text: &mut String, doc: &str, indent: usize) {
    for line in doc.trim().lines().map(str::trim) {
        let _ = writeln!(text, "{:indent$}{line}", "");
    }
}

fn summary(doc: &str) -> String {
    // A sentence may go over lines.
    let mut text = String::new();
    for line in doc.trim().lines().map(str::trim).take_while(|line| !line.is_empty()) {
        if !text.is_empty() {
            text.push(' ');
        }
        text.push_str(line);
        if line.ends_with('.') {
            break;
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_yaml_to_type() {
        let shown = |value| yaml(&value);
        assert_eq!(shown(serde_json::json!("soft")), "soft");
        assert_eq!(shown(serde_json::json!({"soft": {"knee": 0.8}})), "{soft: {knee: 0.8}}");
        assert_eq!(shown(serde_json::json!([-90.0, 90.0])), "[-90.0, 90.0]");
        assert_eq!(shown(serde_json::json!("no")), "\"no\"");
    }

    #[test]
    fn every_port_and_parameter_of_every_node_is_told_and_documented() {
        let registry = crate::registry();
        assert!(list(&registry).lines().count() > 13);
        for node in registry.nodes() {
            let text = describe(&node.spec);
            let spec = &node.spec;
            assert!(!summary(spec.doc).is_empty(), "{}", spec.name);
            for (name, doc) in spec
                .inputs
                .iter()
                .chain(&spec.outputs)
                .map(|port| (port.name, port.doc))
                .chain(spec.params.iter().map(|param| (param.name, param.doc)))
            {
                assert!(text.contains(name), "{}.{name}", spec.name);
                assert!(!doc.trim().is_empty(), "{}.{name} has no doc", spec.name);
            }
        }
    }
}
