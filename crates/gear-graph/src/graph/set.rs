//! Overrides from the command line: `NODE.PARAM=VALUE`, `INPUT.PARAM=VALUE`.
//!
//! They are written into the tree before it is checked, so that they get the same messages as the file.

use super::mistakes::SET;
use super::{Source, nearest, yaml};
use crate::{Problem, Span, Spanned, Tree, TreeKind};

/// Applies the overrides in order; each becomes a source of its own, so that messages point into it.
pub fn apply(mut tree: Tree, sets: &[String], sources: &mut Vec<Source>, problems: &mut Vec<Problem>) -> Tree {
    for set in sets {
        let source = sources.len() as u32;
        sources.push(Source {
            name: SET.to_string(),
            text: set.clone(),
        });
        if let Err(problem) = apply_one(&mut tree, set, source, problems) {
            problems.push(problem);
        }
    }
    tree
}

fn apply_one(tree: &mut Tree, set: &str, source: u32, problems: &mut Vec<Problem>) -> Result<(), Problem> {
    let at = |start: usize, len: usize| Span {
        source,
        start: start as u32,
        len: len as u32,
    };
    let bad_form = || {
        Problem::error(
            "bad-override",
            format!("`{set}` is no override"),
            at(0, set.len()),
            "expected NODE.PARAM=VALUE",
        )
        .help("for example `ratio.radius=0.05`, or for a method's parameter `edges.method.canny.low=0.1`")
    };
    let (path, text) = set.split_once('=').ok_or_else(bad_form)?;
    let names: Vec<&str> = path.split('.').collect();
    if names.len() < 2 || names.iter().any(|name| name.trim().is_empty()) {
        return Err(bad_form());
    }
    // Spaces in place of the path keep the value's positions right.
    let padded = format!("{}{text}", " ".repeat(path.len() + 1));
    let Some(value) = yaml::parse(&padded, source, problems) else {
        return Ok(()); // reported by the parser
    };

    let mut spans = Vec::new();
    let mut start = 0;
    for name in &names {
        spans.push(at(start, name.len()));
        start += name.len() + 1;
    }
    let owner = names[0];
    let mut choices = Vec::new();
    for section in ["nodes", "inputs"] {
        let Some(entries) = entry(tree, section).and_then(entries) else {
            continue;
        };
        choices.extend(entries.iter().map(|(key, _)| key.value.clone()));
        if let Some((_, site)) = entries.iter_mut().find(|(key, _)| key.value == owner) {
            write(site, &names[1..], &spans[1..], value);
            return Ok(());
        }
    }
    Err(Problem::error(
        "unknown-override",
        format!("the graph has no node and no input named `{owner}`"),
        spans[0],
        "unknown name",
    )
    .help(match nearest(owner, choices.iter().map(String::as_str)) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("its names are {}", choices.join(", ")),
    }))
}

fn entries(tree: &mut Tree) -> Option<&mut Vec<(Spanned<String>, Tree)>> {
    match &mut tree.kind {
        TreeKind::Map(entries) => Some(entries),
        _ => None,
    }
}

fn entry<'t>(tree: &'t mut Tree, name: &str) -> Option<&'t mut Tree> {
    entries(tree)?
        .iter_mut()
        .rev()
        .find(|(key, _)| key.value == name)
        .map(|(_, value)| value)
}

/// Writes `value` at `names` below `with:` of a node or an input.
fn write(site: &mut Tree, names: &[&str], spans: &[Span], value: Tree) {
    // `painting: Image` becomes `painting: {type: Image}`.
    if let TreeKind::Text(_) = site.kind {
        let span = site.span;
        let key = Spanned {
            value: "type".to_string(),
            span,
        };
        let inner = std::mem::replace(&mut site.kind, TreeKind::Null);
        site.kind = TreeKind::Map(vec![(key, Tree { span, kind: inner })]);
    }
    let mut place = site;
    let with = ("with", spans[0]);
    let path = std::iter::once(with).chain(names.iter().copied().zip(spans.iter().copied()));
    for (depth, (name, span)) in path.enumerate() {
        if entries(place).is_none() {
            place.kind = TreeKind::Map(Vec::new());
        }
        // `unwrap_or_default` would lose the map just made; both branches above leave a map.
        let TreeKind::Map(map) = &mut place.kind else { return };
        // Below a parameter stands the name of a method; another method's parameters do not stay beside it.
        if depth >= 2 {
            map.retain(|(key, _)| depth > 2 || key.value == name);
        }
        if !map.iter().any(|(key, _)| key.value == name) {
            let key = Spanned {
                value: name.to_string(),
                span,
            };
            let nothing = Tree {
                span,
                kind: TreeKind::Null,
            };
            map.push((key, nothing));
        }
        let Some((_, next)) = map.iter_mut().rev().find(|(key, _)| key.value == name) else {
            return;
        };
        place = next;
    }
    *place = value;
}
