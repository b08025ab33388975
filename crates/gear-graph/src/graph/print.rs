//! [`Tree`] → the text of a graph file, laid out as one writes it by hand.

use std::fmt::Write;

use crate::{Spanned, Tree, TreeKind};

/// Lines that would be longer are broken after the keys of a node.
const WIDTH: usize = 120;

/// A graph as a file: a line a node, comments and places lost.
pub fn graph(tree: &Tree) -> String {
    let mut text = String::new();
    let top = match &tree.kind {
        TreeKind::Map(top) if !top.is_empty() => top,
        _ => return flow(tree) + "\n",
    };
    for (i, (key, section)) in top.iter().enumerate() {
        match &section.kind {
            TreeKind::Map(entries) if !entries.is_empty() => {
                let gap = if i > 0 { "\n" } else { "" };
                let _ = writeln!(text, "{gap}{}:", scalar(&key.value));
                for (name, site) in entries {
                    entry(&mut text, name, site);
                }
            }
            _ => {
                let _ = writeln!(text, "{}: {}", scalar(&key.value), flow(section));
            }
        }
    }
    text
}

fn entry(text: &mut String, name: &Spanned<String>, site: &Tree) {
    let name = scalar(&name.value);
    let line = flow(site);
    match &site.kind {
        TreeKind::Map(parts) if name.len() + line.len() + 4 > WIDTH => {
            let _ = writeln!(text, "  {name}:");
            for (key, part) in parts {
                let _ = writeln!(text, "    {}: {}", scalar(&key.value), flow(part));
            }
        }
        _ => {
            let _ = writeln!(text, "  {name}: {line}");
        }
    }
}

/// A value in one line.
fn flow(tree: &Tree) -> String {
    match &tree.kind {
        TreeKind::Null => "null".to_owned(),
        TreeKind::Bool(b) => b.to_string(),
        TreeKind::Integer(i) => i.to_string(),
        TreeKind::Float(f) if f.is_nan() => ".nan".to_owned(),
        TreeKind::Float(f) if f.is_infinite() => if *f > 0.0 { ".inf" } else { "-.inf" }.to_owned(),
        TreeKind::Float(f) => format!("{f:?}"),
        TreeKind::Text(text) => scalar(text),
        TreeKind::List(items) => {
            let items: Vec<_> = items.iter().map(flow).collect();
            format!("[{}]", items.join(", "))
        }
        TreeKind::Map(entries) => {
            let entries: Vec<_> = entries
                .iter()
                .map(|(key, value)| format!("{}: {}", scalar(&key.value), flow(value)))
                .collect();
            format!("{{{}}}", entries.join(", "))
        }
    }
}

/// A text: as it is if every reader takes it for that text, else in double quotes.
fn scalar(text: &str) -> String {
    // What some version of YAML takes for something else.
    const WORDS: [&str; 9] = ["null", "true", "false", "yes", "no", "on", "off", "y", "n"];
    let plain = text.starts_with(|c: char| c.is_alphabetic() || c == '_')
        && text
            .chars()
            .all(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '/'))
        && !WORDS.contains(&text.to_ascii_lowercase().as_str());
    if plain {
        return text.to_owned();
    }
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            ' ' => quoted.push(c),
            c if c.is_ascii_graphic() || c.is_alphanumeric() => quoted.push(c),
            c if c < '\u{100}' => quoted.push_str(&format!("\\x{:02x}", c as u32)),
            c if c < '\u{10000}' => quoted.push_str(&format!("\\u{:04x}", c as u32)),
            c => quoted.push_str(&format!("\\U{:08x}", c as u32)),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Span;
    use crate::graph::yaml;

    fn tree(kind: TreeKind) -> Tree {
        Tree {
            span: Span::default(),
            kind,
        }
    }

    /// Without places.
    fn bare(read: Tree) -> Tree {
        tree(match read.kind {
            TreeKind::List(items) => TreeKind::List(items.into_iter().map(bare).collect()),
            TreeKind::Map(entries) => TreeKind::Map(
                entries
                    .into_iter()
                    .map(|(key, value)| (name(&key.value), bare(value)))
                    .collect(),
            ),
            kind => kind,
        })
    }

    fn name(text: &str) -> Spanned<String> {
        Spanned {
            value: text.to_owned(),
            span: Span::default(),
        }
    }

    fn text() -> impl Strategy<Value = String> {
        prop_oneof![
            "[a-zA-Z0-9_.-]{0,8}",
            ".{0,8}",
            any::<String>(),
            prop::sample::select(vec![
                "no", "012", "1_000", "~", "null", "1:30", "@gear", "- a", "a: b", "#x", ".inf", "0x1F", "1e3"
            ])
            .prop_map(str::to_owned),
        ]
    }

    fn any_tree() -> impl Strategy<Value = Tree> {
        let leaf = prop_oneof![
            Just(TreeKind::Null),
            any::<bool>().prop_map(TreeKind::Bool),
            any::<i64>().prop_map(TreeKind::Integer),
            prop_oneof![
                Just(f64::INFINITY),
                Just(f64::NEG_INFINITY),
                -1e300..1e300,
                -1.0..1.0f64
            ]
            .prop_map(TreeKind::Float),
            text().prop_map(TreeKind::Text),
        ]
        .prop_map(tree);
        leaf.prop_recursive(4, 40, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(|items| tree(TreeKind::List(items))),
                prop::collection::vec((text(), inner), 0..6).prop_map(|entries| {
                    let entries = entries.into_iter().map(|(key, value)| (name(&key), value));
                    tree(TreeKind::Map(entries.collect()))
                }),
            ]
        })
    }

    proptest! {
        #[test]
        fn what_is_printed_reads_back(tree in any_tree()) {
            let text = graph(&tree);
            let mut problems = Vec::new();
            let read = yaml::parse(&text, 0, &mut problems);
            prop_assert!(problems.is_empty(), "{text}\n{problems:?}");
            prop_assert_eq!(read.map(bare), Some(tree), "{}", text);
        }
    }
}
