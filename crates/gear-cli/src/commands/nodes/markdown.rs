//! `gear nodes --markdown`: the reference, from the same definitions that the graphs are checked with.

use std::fmt::Write;

use gear_graph::{Limits, LoaderSpec, NodeSpec, ParamKind, ParamSpec, PortSpec, Registry, ValueType};

use super::{summary, yaml};

/// What brings the reference in the book up to date.
pub const UPDATE: &str = "cargo run --bin gear -- nodes --markdown > docs/src/reference.md";

const HEAD: &str = "\
<!-- Written by `gear nodes --markdown` from the definitions of the nodes. Edit their doc comments, then run
     `cargo run --bin gear -- nodes --markdown > docs/src/reference.md`. -->

# Reference

Every node, every type of value, and what may be given as a file. `gear nodes NAME` shows the same for one of them. Inputs
are needed unless said otherwise; every parameter has a default unless said otherwise.
";

/// The whole reference, of the nodes that are part of the program.
pub fn reference(registry: &Registry) -> String {
    let own = registry
        .nodes()
        .map(|node| &*node.spec)
        .filter(|spec| spec.plugin.is_none());
    let nodes: Vec<&NodeSpec> = own.collect();
    let loaders: Vec<&LoaderSpec> = registry.loaders().map(|loader| &*loader.spec).collect();
    let mut text = HEAD.to_owned();
    text.push_str("\n| node | what it gives |\n|---|---|\n");
    for spec in &nodes {
        let _ = writeln!(text, "{}", row(spec));
    }
    text.push_str("\n## Nodes\n");
    for spec in &nodes {
        let _ = write!(text, "\n{}", node(spec, 3));
    }
    text.push_str(
        "\n## Values\n\nWhat travels on the edges of a graph.\n\n| type | file | what it holds |\n|---|---|---|\n",
    );
    for value in registry.values() {
        let _ = writeln!(text, "{}", value_row(value));
    }
    text.push_str(
        "\n## Inputs given as files\n\nWhat a graph may say about an input, as `NAME: {type: TYPE, with: {…}}`.\n",
    );
    for spec in &loaders {
        let _ = write!(text, "\n{}", loader(spec, 3));
    }
    text
}

/// A reference with one more node, where its name belongs; `None` if the text is no reference, or has the node.
pub fn with_node(reference: &str, spec: &NodeSpec) -> Option<String> {
    let mut lines: Vec<&str> = reference.lines().collect();
    let place = |lines: &[&str], begin: &str, end: &str| {
        let name = |line: &str| Some(line.strip_prefix(begin)?.split(']').next()?.to_owned());
        let known: Vec<(usize, String)> = (0..lines.len()).filter_map(|i| Some((i, name(lines[i])?))).collect();
        let last = lines.iter().position(|line| *line == end)?;
        let known = known.into_iter().filter(|(i, _)| *i < last);
        let mut later = known.filter(|(_, name)| name.as_str() >= spec.name);
        match later.next() {
            Some((_, name)) if name == spec.name => None,
            Some((i, _)) => Some(i),
            None => Some(last),
        }
    };
    let section = format!("{}\n", node(spec, 3));
    let at = place(&lines, "### ", "## Values")?;
    lines.splice(at..at, section.lines());
    // A blank line parts the table from what follows.
    let at = place(&lines, "| [", "## Nodes")?;
    let row = row(spec);
    lines.insert(if lines[at] == "## Nodes" { at - 1 } else { at }, &row);
    Some(lines.join("\n") + "\n")
}

fn row(spec: &NodeSpec) -> String {
    let anchor = spec.name.to_ascii_lowercase();
    format!("| [{}](#{anchor}) | {} |", spec.name, cell(&summary(spec.doc)))
}

/// One node, under a heading of that level.
pub fn node(spec: &NodeSpec, level: usize) -> String {
    let mut text = format!("{} {}\n\n{}\n\n", "#".repeat(level), spec.name, plain(spec.doc));
    let _ = writeln!(text, "Version {}.{}", spec.version, used(&spec.numerics));
    if let Some(remark) = super::not_deterministic(spec) {
        let _ = writeln!(text, "{remark}");
    }
    ports(&mut text, "Inputs", &spec.inputs, true);
    ports(&mut text, "Outputs", &spec.outputs, false);
    if !spec.params.is_empty() {
        text.push_str("\n**Parameters**\n\n");
        params(&mut text, &spec.params, 0);
    }
    text
}

/// What a graph may say about an input of this type, under a heading of that level.
pub fn loader(spec: &LoaderSpec, level: usize) -> String {
    let name = spec.value_type.name;
    let mut text = format!("{} {name}, as a file\n\n{}\n\n", "#".repeat(level), plain(spec.doc));
    let _ = writeln!(text, "Version {}.{}", spec.version, used(&spec.numerics));
    if !spec.params.is_empty() {
        text.push_str("\n**Parameters**\n\n");
        params(&mut text, &spec.params, 0);
    }
    text
}

fn used(numerics: &[gear_graph::Numerics]) -> String {
    if numerics.is_empty() {
        return String::new();
    }
    let used: Vec<_> = numerics.iter().map(|n| format!("{} {}", n.name, n.version)).collect();
    format!(" Numerics: {}.", used.join(", "))
}

fn value_row(value: &ValueType) -> String {
    format!("| {} | `.{}` | {} |", value.name, value.extension, cell(value.doc))
}

fn ports(text: &mut String, title: &str, ports: &[PortSpec], inputs: bool) {
    if ports.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n**{title}**\n");
    for port in ports {
        let mut remarks = vec![if port.many {
            format!("a list of {}", port.value_type.name)
        } else {
            port.value_type.name.to_owned()
        }];
        if port.optional && !port.many {
            remarks.push("optional".to_owned());
        }
        if port.lazy && inputs {
            remarks.push("computed only if needed".to_owned());
        }
        let _ = writeln!(
            text,
            "- `{}` ({}): {}",
            port.name,
            remarks.join(", "),
            indented(port.doc, 2)
        );
    }
}

fn params(text: &mut String, specs: &[ParamSpec], indent: usize) {
    for param in specs {
        let mut facts = vec![param.kind.describe()];
        if param.limits != Limits::default() {
            facts.push(param.limits.to_string());
        }
        facts.push(match &param.default {
            Some(default) => format!("default `{}`", yaml(default)),
            None => "must be given".to_owned(),
        });
        let doc = indented(param.doc, indent + 2);
        let _ = writeln!(text, "{:indent$}- `{}` ({}): {doc}", "", param.name, facts.join("; "));
        if let ParamKind::Choice { variants } = &param.kind {
            let indent = indent + 2;
            for variant in variants {
                let doc = indented(variant.doc, indent + 2);
                let _ = writeln!(text, "{:indent$}- `{}`: {doc}", "", variant.name);
                params(text, &variant.params, indent + 2);
            }
        }
    }
}

/// A doc comment without the spaces after `///`.
fn plain(doc: &str) -> String {
    doc.trim().lines().map(str::trim).collect::<Vec<_>>().join("\n")
}

/// A doc comment that goes on within a list.
fn indented(doc: &str, indent: usize) -> String {
    let mut text = String::new();
    for (i, line) in doc.trim().lines().map(str::trim).enumerate() {
        if i > 0 {
            text.push('\n');
        }
        if i > 0 && !line.is_empty() {
            let _ = write!(text, "{:indent$}", "");
        }
        text.push_str(line);
    }
    text
}

/// A text in a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_in_the_book_is_current() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/reference.md");
        let kept = std::fs::read_to_string(path).unwrap_or_default();
        assert!(
            kept == reference(&crate::registry()),
            "docs/src/reference.md does not say what the nodes say; update it with\n\n    {UPDATE}\n"
        );
    }

    #[test]
    fn a_node_is_entered_where_the_whole_reference_would_have_it() {
        let all = crate::registry();
        let whole = reference(&all);
        for node in all.nodes() {
            let spec = &node.spec;
            let section = format!("{}\n", super::node(spec, 3));
            let without = whole.replace(&section, "").replace(&format!("{}\n", row(spec)), "");
            assert!(without.len() < whole.len() - section.len());
            assert_eq!(
                with_node(&without, spec).as_deref(),
                Some(whole.as_str()),
                "{}",
                spec.name
            );
            assert_eq!(with_node(&whole, spec), None);
            assert_eq!(with_node("another text", spec), None);
        }
    }

    #[test]
    fn everything_that_a_graph_may_name_is_in_it() {
        let registry = crate::registry();
        let text = reference(&registry);
        for node in registry.nodes() {
            assert!(text.contains(&format!("\n### {}\n", node.spec.name)));
            let spec = &node.spec;
            for name in spec.inputs.iter().chain(&spec.outputs).map(|port| port.name) {
                assert!(text.contains(&format!("- `{name}` (")), "{}.{name}", spec.name);
            }
            told(&text, &spec.params);
        }
        for loader in registry.loaders() {
            told(&text, &loader.spec.params);
        }
        for value in registry.values() {
            assert!(!value.doc.is_empty(), "{} has no doc", value.name);
            assert!(text.contains(&value_row(value)));
        }
    }

    fn told(text: &str, params: &[ParamSpec]) {
        for param in params {
            assert!(text.contains(&format!("- `{}` (", param.name)), "{}", param.name);
            assert!(param.limits.unit.is_none_or(|unit| text.contains(unit)));
            if let ParamKind::Choice { variants } = &param.kind {
                for variant in variants {
                    assert!(text.contains(&format!("- `{}`: ", variant.name)), "{}", variant.name);
                    told(text, &variant.params);
                }
            }
        }
    }
}
