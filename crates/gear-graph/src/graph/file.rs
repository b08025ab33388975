//! [`Tree`] → the names of a graph file, each with its place. Keys are checked here, names in [`super::check`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::overlay::Removed;
use super::snapshots::FileSnapshot;
use super::suggest::glued;
use super::{GRAPH_VERSION, nearest, snapshots};
use crate::params::yaml_trap;
use crate::{Problem, Spanned, Tree, TreeKind};

/// What a graph file says, before any name is looked up.
pub struct File<'t> {
    pub removed: &'t Removed,
    pub inputs: Vec<FileInput<'t>>,
    pub nodes: Vec<FileNode<'t>>,
    pub outputs: Vec<(&'t Spanned<String>, Spanned<&'t str>)>,
    pub snapshots: Vec<FileSnapshot<'t>>,
}

pub struct FileInput<'t> {
    pub name: &'t Spanned<String>,
    pub type_name: Option<Spanned<&'t str>>,
    pub optional: bool,
    pub with: Option<&'t Tree>,
}

pub struct FileNode<'t> {
    pub id: &'t Spanned<String>,
    pub node: Option<Spanned<&'t str>>,
    pub inputs: Vec<(&'t Spanned<String>, Wiring<'t>)>,
    pub with: Option<&'t Tree>,
}

/// What stands behind a port: one reference or a list of them.
pub struct Wiring<'t> {
    pub refs: Vec<Spanned<&'t str>>,
    pub list: bool,
}

/// Names become parts of file names, which systems limit to 255 bytes.
pub(super) const LONGEST_NAME: usize = 60;

/// What a run writes beside its outputs: `run.json` and `report.html`.
pub(super) const RESERVED: [&str; 2] = ["run", "report"];

pub(super) type Entries<'t> = &'t [(Spanned<String>, Tree)];

/// Reads a whole file, the versions apart. `None` if it is no map at all.
pub fn read<'t>(tree: &'t Tree, removed: &'t Removed, problems: &mut Vec<Problem>) -> Option<File<'t>> {
    let mut file = File {
        removed,
        inputs: Vec::new(),
        nodes: Vec::new(),
        outputs: Vec::new(),
        snapshots: Vec::new(),
    };
    let top = map(tree, "a graph file", problems)?;
    keys(
        top,
        "a graph file",
        &["gear", "extends", "inputs", "nodes", "outputs", "snapshots"],
        problems,
    );
    for (name, tree) in section(top, "inputs", problems) {
        file.inputs.push(input(name, tree, problems));
    }
    for (id, tree) in section(top, "nodes", problems) {
        file.nodes.extend(node(id, tree, problems));
    }
    let outputs = section(top, "outputs", problems);
    file_names("output", outputs, &RESERVED, problems);
    for (name, tree) in outputs {
        if tree.kind == TreeKind::Null && glued(&name.value).is_some() {
            continue; // reported as a bad name, with what was meant
        }
        if let Some(source) = text(tree, &format!("output `{}`", name.value), "`node.port`", problems) {
            file.outputs.push((name, source));
        }
    }
    let snapshots = section(top, "snapshots", problems);
    file_names("snapshot", snapshots, &[], problems);
    for (name, tree) in snapshots {
        file.snapshots.extend(snapshots::read(name, tree, problems));
    }
    if get(top, "outputs").is_none_or(|tree| match &tree.kind {
        TreeKind::Map(outputs) => outputs.is_empty(),
        TreeKind::Null => true,
        _ => false,
    }) {
        problems.push(
            Problem::error(
                "no-outputs",
                "the graph has no outputs",
                tree.span,
                "`outputs` is missing",
            )
            .help("without outputs nothing is ever computed; add `outputs: {name: node.port}`"),
        );
    }
    Some(file)
}

/// The one thing to say of a file of a version to come.
pub fn too_new(tree: &Tree) -> Option<Problem> {
    let TreeKind::Map(top) = &tree.kind else {
        return None;
    };
    let tree = get(top, "gear")?;
    let TreeKind::Integer(newer) = tree.kind else {
        return None;
    };
    (newer > GRAPH_VERSION).then(|| {
        Problem::error(
            "version-too-new",
            format!("the file is of version {newer}, this program reads up to version {GRAPH_VERSION}"),
            tree.span,
            "too new",
        )
        .help("use a newer gear")
    })
}

/// Whether the file says that it is of this version. One that is no map is reported by [`read`].
pub fn version(tree: &Tree, problems: &mut Vec<Problem>) {
    let TreeKind::Map(top) = &tree.kind else {
        return;
    };
    match get(top, "gear") {
        None => problems.push(
            Problem::error(
                "missing-version",
                "the file does not say which version it is",
                tree.span,
                "no `gear:` here",
            )
            .help(
                match ["study", "curve"].into_iter().find(|kind| get(top, kind).is_some()) {
                    Some(kind) => format!("this is a {kind}, not a graph: `gear {kind}` runs it"),
                    None => format!("begin with `gear: {GRAPH_VERSION}`"),
                },
            ),
        ),
        Some(tree) => match tree.kind {
            TreeKind::Integer(GRAPH_VERSION) => {}
            TreeKind::Integer(newer) if newer > GRAPH_VERSION => {} // see `too_new`
            _ => problems.push(
                Problem::error(
                    "bad-version",
                    format!("the version must be a whole number from 1, found {}", tree.describe()),
                    tree.span,
                    "no version",
                )
                .help(format!("write `gear: {GRAPH_VERSION}`")),
            ),
        },
    }
}

fn input<'t>(name: &'t Spanned<String>, tree: &'t Tree, problems: &mut Vec<Problem>) -> FileInput<'t> {
    good_name(name, "input", problems);
    let mut input = FileInput {
        name,
        type_name: None,
        optional: false,
        with: None,
    };
    let what = format!("input `{}`", name.value);
    if let TreeKind::Text(type_name) = &tree.kind {
        input.type_name = Some(Spanned {
            value: type_name,
            span: tree.span,
        });
        return input;
    }
    let Some(entries) = map(tree, &what, problems) else {
        return input;
    };
    keys(entries, &what, &["type", "optional", "with"], problems);
    match get(entries, "type") {
        Some(tree) => input.type_name = text(tree, &what, "a type's name", problems),
        None => problems.push(
            Problem::error(
                "missing-type",
                format!("{what} has no type"),
                name.span,
                "`type` is missing",
            )
            .help(format!("write `{}: {{type: Image}}`", name.value)),
        ),
    }
    match get(entries, "optional").map(|tree| (tree, &tree.kind)) {
        None => {}
        Some((_, TreeKind::Bool(optional))) => input.optional = *optional,
        Some((tree, _)) => problems.push(
            Problem::error(
                "wrong-type",
                format!("`optional` of {what} takes true or false, found {}", tree.describe()),
                tree.span,
                "expected true or false",
            )
            .maybe_help(yaml_trap(tree, "true or false")),
        ),
    }
    input.with = get(entries, "with");
    input
}

fn node<'t>(id: &'t Spanned<String>, tree: &'t Tree, problems: &mut Vec<Problem>) -> Option<FileNode<'t>> {
    good_name(id, "node", problems);
    let what = format!("node `{}`", id.value);
    let entries = map(tree, &what, problems)?;
    keys(entries, &what, &["node", "in", "with"], problems);
    let mut node = FileNode {
        id,
        node: None,
        inputs: Vec::new(),
        with: get(entries, "with"),
    };
    match get(entries, "node") {
        Some(tree) => node.node = text(tree, &what, "a node type's name", problems),
        None => problems.push(
            Problem::error(
                "missing-node-type",
                format!("{what} has no type"),
                id.span,
                "`node` is missing",
            )
            .help("write `node: TYPE`; `gear nodes` lists the types"),
        ),
    }
    let inputs = match get(entries, "in") {
        None => &[],
        Some(tree) => map(tree, &format!("`in` of {what}"), problems).unwrap_or_default(),
    };
    for (port, tree) in inputs {
        if matches!(
            (port.value.as_str(), &tree.kind),
            ("with" | "node", TreeKind::Map(_) | TreeKind::Null)
        ) {
            problems.push(beside(port, &what));
            continue;
        }
        let what = format!("port `{}` of {what}", port.value);
        let expected = "an input's name or `node.port`";
        let wiring = match &tree.kind {
            TreeKind::List(items) => Wiring {
                refs: items
                    .iter()
                    .filter_map(|item| text(item, &what, expected, problems))
                    .collect(),
                list: true,
            },
            // The port is reported as unknown, with what was meant.
            TreeKind::Null if glued(&port.value).is_some() => Wiring {
                refs: Vec::new(),
                list: false,
            },
            _ => Wiring {
                refs: text(tree, &what, expected, problems).into_iter().collect(),
                list: false,
            },
        };
        node.inputs.push((port, wiring));
    }
    Some(node)
}

/// A key of a node that stands among its wires.
fn beside(key: &Spanned<String>, what: &str) -> Problem {
    let key_name = &key.value;
    Problem::error(
        "wrong-type",
        format!("`{key_name}` stands within `in` of {what}"),
        key.span,
        "this is no port",
    )
    .help(format!("write it beside `in`: `in: {{…}}, {key_name}: {{…}}`"))
}

/// A name must be usable in `node.port`, in `--set` and as the name of a file.
fn good_name(name: &Spanned<String>, what: &str, problems: &mut Vec<Problem>) {
    let good = name.value.chars().count() <= LONGEST_NAME
        && name.value.starts_with(char::is_alphabetic)
        && name
            .value
            .chars()
            .all(|c| c.is_alphabetic() || c.is_ascii_digit() || c == '_' || c == '-');
    if !good {
        problems.push(
            Problem::error(
                "bad-name",
                format!("`{}` cannot be the name of an {what}", name.value)
                    .replace("an node", "a node")
                    .replace("an snapshot", "a snapshot"),
                name.span,
                "not a name",
            )
            .help(glued(&name.value).unwrap_or_else(|| {
                format!("a name is a letter, then letters, digits, `_` and `-`; at most {LONGEST_NAME} characters")
            })),
        );
    }
}

/// Outputs become files beside the record of the run, and snapshots files in one folder, also where capitals do not tell
/// files apart.
fn file_names(what: &str, entries: Entries<'_>, reserved: &[&str], problems: &mut Vec<Problem>) {
    let mut seen: HashMap<String, &Spanned<String>> = HashMap::new();
    for (name, _) in entries {
        good_name(name, what, problems);
        let lower = name.value.to_lowercase();
        if reserved.contains(&lower.as_str()) {
            problems.push(
                Problem::error(
                    "reserved-name",
                    format!("an {what} cannot be named `{}`", name.value),
                    name.span,
                    "taken",
                )
                .help("a run writes files of that name itself; give the output another one"),
            );
        }
        match seen.entry(lower) {
            Entry::Vacant(entry) => {
                entry.insert(name);
            }
            // The very same key twice is reported for every map.
            Entry::Occupied(first) if first.get().value != name.value => problems.push(
                Problem::error(
                    "duplicate-name",
                    format!(
                        "the {what}s `{}` and `{}` differ only in capitals",
                        first.get().value,
                        name.value
                    ),
                    name.span,
                    "again here",
                )
                .label(first.get().span, "first here")
                .help("their files would be the same on some systems; give one of them another name"),
            ),
            Entry::Occupied(_) => {}
        }
    }
}

/// What a file extends, if it does.
pub fn extends<'t>(tree: &'t Tree, problems: &mut Vec<Problem>) -> Option<Spanned<&'t str>> {
    let TreeKind::Map(top) = &tree.kind else {
        return None;
    };
    text(
        get(top, "extends")?,
        "`extends`",
        "the path of a graph file, or `@name`",
        problems,
    )
}

pub(super) fn get<'t>(entries: Entries<'t>, key: &str) -> Option<&'t Tree> {
    entries.iter().rev().find(|(k, _)| k.value == key).map(|(_, tree)| tree)
}

fn section<'t>(top: Entries<'t>, key: &str, problems: &mut Vec<Problem>) -> Entries<'t> {
    get(top, key)
        .and_then(|tree| map(tree, &format!("`{key}`"), problems))
        .unwrap_or_default()
}

pub(super) fn map<'t>(tree: &'t Tree, what: &str, problems: &mut Vec<Problem>) -> Option<Entries<'t>> {
    match &tree.kind {
        TreeKind::Map(entries) => Some(entries),
        TreeKind::Null if what.starts_with('`') => Some(&[]),
        _ => {
            problems.push(Problem::error(
                "wrong-type",
                format!("{what} must be a map, found {}", tree.describe()),
                tree.span,
                "expected a map",
            ));
            None
        }
    }
}

pub(super) fn text<'t>(
    tree: &'t Tree,
    what: &str,
    expected: &str,
    problems: &mut Vec<Problem>,
) -> Option<Spanned<&'t str>> {
    match &tree.kind {
        TreeKind::Text(value) => Some(Spanned { value, span: tree.span }),
        _ => {
            problems.push(Problem::error(
                "wrong-type",
                format!("{what} takes {expected}, found {}", tree.describe()),
                tree.span,
                format!("expected {expected}"),
            ));
            None
        }
    }
}

pub(super) fn keys(entries: Entries<'_>, what: &str, known: &[&str], problems: &mut Vec<Problem>) {
    for (key, _) in entries {
        if known.contains(&key.value.as_str()) {
            continue;
        }
        problems.push(
            Problem::error(
                "unknown-key",
                format!("{what} has no key `{}`", key.value),
                key.span,
                "unknown key",
            )
            .help(match (glued(&key.value), meant(&key.value, entries, known)) {
                (Some(apart), _) => apart,
                (None, Some(name)) => format!("write `{name}`"),
                (None, None) => match nearest(&key.value, known.iter().copied()) {
                    Some(name) => format!("did you mean `{name}`?"),
                    None => format!("its keys are {}", known.join(", ")),
                },
            }),
        );
    }
}

/// The key of gear's that is called otherwise elsewhere, unless it is there as well.
fn meant(key: &str, entries: Entries<'_>, known: &[&str]) -> Option<&'static str> {
    const OTHERS: [(&str, &[&str]); 6] = [
        ("in", &["inputs", "input", "from", "wires"]),
        (
            "with",
            &["params", "parameters", "param", "args", "options", "settings"],
        ),
        ("node", &["type", "kind", "op", "class"]),
        ("type", &["node", "kind", "class"]),
        ("nodes", &["steps", "graph"]),
        ("gear", &["version"]),
    ];
    let other = OTHERS
        .iter()
        .find(|(name, others)| known.contains(name) && others.contains(&key) && get(entries, name).is_none());
    other.map(|(name, _)| *name)
}
