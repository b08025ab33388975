//! A graph over another: names that the overlay gives replace those of its base.
//!
//! Inputs, nodes, outputs and snapshots are replaced by name; within a snapshot key by key; within a node or an input,
//! `in` is replaced port by port and `with` parameter by parameter. A method with parameters of its own is merged with the same method and replaces another
//! one. Another type of node or of input takes no parameters from the one that it replaces. `null` removes an input,
//! a node, an output, a snapshot, a wire or a parameter. A section or map with nothing in it changes nothing.
//!
//! A parameter that is removed has its default again, so removing one that no base sets is no mistake: whoever writes
//! an overlay need not know what its base says. Such names are kept apart, to be compared with those of the node type.
//!
//! Everything keeps the place where it was written, so that a mistake points into the right file. The name of what an
//! overlay touches has its place in the overlay.

use std::collections::HashMap;

use super::nearest;
use crate::{Problem, Span, Spanned, Tree, TreeKind};

type Entry = (Spanned<String>, Tree);

/// Inputs and nodes that an overlay removed, with the place where it did.
pub type Removed = HashMap<String, Span>;

/// A parameter that an overlay removes and that no base sets.
pub struct Unset {
    /// The input or node.
    pub site: String,
    /// Within which methods, from outside: the parameter that takes methods, and the method.
    pub within: Vec<(String, String)>,
    /// The parameter.
    pub param: Spanned<String>,
}

/// Graphs laid over each other.
pub struct Laid {
    pub tree: Tree,
    pub removed: Removed,
    pub unset: Vec<Unset>,
}

/// Lays the trees over each other; the last one is the base of all.
pub fn lay(trees: Vec<Tree>, problems: &mut Vec<Problem>) -> Option<Laid> {
    let mut overlay = Overlay {
        removed: Removed::new(),
        unset: Vec::new(),
        problems,
    };
    let mut trees = trees.into_iter().rev();
    let mut base = trees.next()?;
    for tree in trees {
        base = overlay.graph(base, tree);
    }
    Some(Laid {
        tree: base,
        removed: overlay.removed,
        unset: overlay.unset,
    })
}

struct Overlay<'p> {
    removed: Removed,
    unset: Vec<Unset>,
    problems: &'p mut Vec<Problem>,
}

impl Overlay<'_> {
    fn graph(&mut self, base: Tree, over: Tree) -> Tree {
        let (TreeKind::Map(entries), span) = (over.kind, over.span) else {
            return base;
        };
        let TreeKind::Map(base) = base.kind else {
            return base; // reported when the names are read
        };
        let mut merged = Map::of(base);
        for (key, tree) in entries {
            match key.value.as_str() {
                "extends" => {}
                section @ ("inputs" | "nodes" | "outputs" | "snapshots") => {
                    let base = merged.take(section);
                    let tree = self.section(section, base, tree);
                    merged.put(key, tree);
                }
                _ => merged.put(key, tree),
            }
        }
        Tree {
            span,
            kind: TreeKind::Map(merged.entries()),
        }
    }

    fn section(&mut self, section: &str, base: Option<Tree>, over: Tree) -> Tree {
        let entries = match over.kind {
            TreeKind::Map(entries) => entries,
            TreeKind::Null => Vec::new(),
            _ => {
                self.problems.push(Problem::error(
                    "wrong-type",
                    format!("`{section}` must be a map, found {}", over.describe()),
                    over.span,
                    "expected a map",
                ));
                Vec::new()
            }
        };
        let mut merged = match base.map(|base| (base.kind, base.span)) {
            Some((TreeKind::Map(base), _)) => Map::of(base),
            None | Some((TreeKind::Null, _)) => Map::default(),
            // Reported when the names are read.
            Some((kind, span)) => return Tree { kind, span },
        };
        let what = section.trim_end_matches('s');
        let is_site = matches!(what, "input" | "node");
        for (key, tree) in entries {
            let base = merged.take(&key.value);
            if tree.kind == TreeKind::Null {
                match base {
                    Some(_) if is_site => {
                        self.removed.insert(key.value, key.span);
                    }
                    Some(_) => {}
                    None => self.nothing_to_remove(&key, &format!("no {what}"), "graph", &merged),
                }
                continue;
            }
            if is_site {
                self.removed.remove(&key.value);
            }
            let tree = match base {
                Some(base) if what == "node" => self.site(base, tree, "node", &key.value),
                Some(base) if what == "input" => {
                    self.site(keyed(base, "type"), keyed(tree, "type"), "type", &key.value)
                }
                Some(base) if what == "snapshot" => {
                    self.site(keyed(base, "port"), keyed(tree, "port"), "port", &key.value)
                }
                None if is_site => self.new_site(tree, &key.value),
                _ => tree,
            };
            merged.put(key, tree);
        }
        Tree {
            span: over.span,
            kind: TreeKind::Map(merged.entries()),
        }
    }

    /// A node or an input that no base has.
    fn new_site(&mut self, mut tree: Tree, name: &str) -> Tree {
        if let TreeKind::Map(entries) = &mut tree.kind {
            for (_, with) in entries.iter_mut().filter(|(key, _)| key.value == "with") {
                self.unset_in(with, name);
            }
        }
        tree
    }

    /// Takes out what a map of parameters removes where nothing is set.
    fn unset_in(&mut self, with: &mut Tree, name: &str) {
        if let TreeKind::Map(entries) = &mut with.kind {
            self.unsetting(name).in_params(entries);
        }
        // Anything else is reported when the parameters are read.
    }

    fn unsetting<'u>(&'u mut self, site: &'u str) -> Unsetting<'u> {
        Unsetting {
            site,
            within: Vec::new(),
            unset: &mut self.unset,
        }
    }

    /// A node over a node, or an input over an input; `kind` is the key that says of which type it is.
    fn site(&mut self, base: Tree, over: Tree, kind: &str, name: &str) -> Tree {
        let (TreeKind::Map(entries), span) = (&over.kind, over.span) else {
            return over; // reported when the names are read
        };
        let TreeKind::Map(base) = base.kind else {
            return over;
        };
        let mut merged = Map::of(base);
        let given = entries.iter().rev().find(|(key, _)| key.value == kind);
        if let Some((_, given)) = given
            && merged.get(kind).is_some_and(|base| base.kind != given.kind)
        {
            merged.take("with");
        }
        let TreeKind::Map(entries) = over.kind else {
            return Tree {
                span,
                kind: TreeKind::Null,
            }; // looked at above
        };
        for (key, tree) in entries {
            let tree = match (key.value.as_str(), merged.take(&key.value)) {
                ("in", Some(base)) => self.wires(base, tree),
                ("with", Some(base)) => self.unsetting(name).params(base, tree),
                ("with", None) => {
                    let mut tree = tree;
                    self.unset_in(&mut tree, name);
                    tree
                }
                _ => tree,
            };
            merged.put(key, tree);
        }
        Tree {
            span,
            kind: TreeKind::Map(merged.entries()),
        }
    }

    fn wires(&mut self, base: Tree, over: Tree) -> Tree {
        let span = over.span;
        let (mut merged, entries) = match maps(base, over) {
            Ok(both) => both,
            Err(one) => return one,
        };
        for (key, tree) in entries {
            let base = merged.take(&key.value);
            match (base, &tree.kind) {
                (Some(_), TreeKind::Null) => {}
                (None, TreeKind::Null) => self.nothing_to_remove(&key, "nothing wired to the port", "node", &merged),
                _ => merged.put(key, tree),
            }
        }
        Tree {
            span,
            kind: TreeKind::Map(merged.entries()),
        }
    }

    fn nothing_to_remove(&mut self, key: &Spanned<String>, lacks: &str, what: &str, base: &Map) {
        let names = base.names();
        let help = match nearest(&key.value, names.clone()) {
            Some(near) => Some(format!("did you mean `{near}`?")),
            None => {
                let names: Vec<_> = names.take(20).collect();
                (!names.is_empty()).then(|| format!("there are {}", names.join(", ")))
            }
        };
        self.problems.push(
            Problem::error(
                "nothing-to-remove",
                format!("the {what} that this one changes has {lacks} `{}`", key.value),
                key.span,
                "nothing to remove",
            )
            .maybe_help(help),
        );
    }
}

/// Lays the parameters of one input or node over others. A `null` over nothing is noted: a parameter of that name may be left
/// to its default so, but there must be one.
struct Unsetting<'u> {
    site: &'u str,
    /// In which methods the parameters at hand are.
    within: Vec<(String, String)>,
    unset: &'u mut Vec<Unset>,
}

impl Unsetting<'_> {
    /// Parameters over parameters.
    fn params(&mut self, base: Tree, over: Tree) -> Tree {
        let span = over.span;
        let (mut merged, entries) = match maps(base, over) {
            Ok(both) => both,
            Err(one) => return one,
        };
        for (key, mut tree) in entries {
            match (merged.take(&key.value), &tree.kind) {
                (Some(_), TreeKind::Null) => continue,
                (None, TreeKind::Null) => {
                    self.note(key);
                    continue;
                }
                (Some(base), _) => tree = self.param(base, tree, &key.value),
                (None, _) => self.in_method(&key.value, &mut tree),
            }
            merged.put(key, tree);
        }
        Tree {
            span,
            kind: TreeKind::Map(merged.entries()),
        }
    }

    /// A method is merged with the same method; every other value is replaced.
    fn param(&mut self, base: Tree, over: Tree, name: &str) -> Tree {
        match (base.kind, over.kind) {
            (TreeKind::Map(mut base), TreeKind::Map(mut entries))
                if base.len() == 1 && entries.len() == 1 && base[0].0.value == entries[0].0.value =>
            {
                let ((_, base), (key, tree)) = (base.remove(0), entries.remove(0));
                self.within.push((name.to_owned(), key.value.clone()));
                let params = self.params(base, tree);
                self.within.pop();
                Tree {
                    span: over.span,
                    kind: TreeKind::Map(vec![(key, params)]),
                }
            }
            (_, kind) => {
                let mut tree = Tree { span: over.span, kind };
                self.in_method(name, &mut tree);
                tree
            }
        }
    }

    /// Takes out what parameters that are new remove.
    fn in_params(&mut self, params: &mut Vec<Entry>) {
        for (key, _) in params.extract_if(.., |(_, tree)| tree.kind == TreeKind::Null) {
            self.note(key);
        }
        for (key, tree) in params {
            self.in_method(&key.value, tree);
        }
    }

    /// The same in a method that is new.
    fn in_method(&mut self, name: &str, tree: &mut Tree) {
        if let TreeKind::Map(entries) = &mut tree.kind
            && let [(method, with)] = entries.as_mut_slice()
            && let TreeKind::Map(params) = &mut with.kind
        {
            self.within.push((name.to_owned(), method.value.clone()));
            self.in_params(params);
            self.within.pop();
        }
    }

    fn note(&mut self, param: Spanned<String>) {
        self.unset.push(Unset {
            site: self.site.to_owned(),
            within: self.within.clone(),
            param,
        });
    }
}

/// Both as maps; or the one of both that counts where one is none.
fn maps(base: Tree, over: Tree) -> Result<(Map, Vec<Entry>), Tree> {
    match (base.kind, over.kind) {
        (TreeKind::Map(base), TreeKind::Map(entries)) => Ok((Map::of(base), entries)),
        (kind, TreeKind::Null) => Err(Tree { span: base.span, kind }),
        (_, kind) => Err(Tree { span: over.span, kind }),
    }
}

/// `Image` as `{type: Image}`, and `node.port` as `{port: node.port}`.
fn keyed(tree: Tree, key: &str) -> Tree {
    let span = tree.span;
    match tree.kind {
        TreeKind::Text(_) => {
            let key = Spanned {
                value: key.to_owned(),
                span,
            };
            Tree {
                span,
                kind: TreeKind::Map(vec![(key, tree)]),
            }
        }
        _ => tree,
    }
}

/// A map in which names are found at once and keep their order.
#[derive(Default)]
struct Map {
    entries: Vec<(Spanned<String>, Option<Tree>)>,
    index: HashMap<String, usize>,
}

impl Map {
    /// Of keys that repeat, which was reported, the last one counts.
    fn of(entries: Vec<Entry>) -> Self {
        let mut map = Self::default();
        for (key, tree) in entries {
            map.put(key, tree);
        }
        map
    }

    fn get(&self, name: &str) -> Option<&Tree> {
        self.entries[*self.index.get(name)?].1.as_ref()
    }

    /// Takes an entry out; what is put under its name later stands at its place.
    fn take(&mut self, name: &str) -> Option<Tree> {
        self.entries[*self.index.get(name)?].1.take()
    }

    fn put(&mut self, key: Spanned<String>, tree: Tree) {
        match self.index.get(&key.value) {
            Some(at) => self.entries[*at] = (key, Some(tree)),
            None => {
                self.index.insert(key.value.clone(), self.entries.len());
                self.entries.push((key, Some(tree)));
            }
        }
    }

    fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.entries
            .iter()
            .filter(|(_, tree)| tree.is_some())
            .map(|(key, _)| key.value.as_str())
    }

    fn entries(self) -> Vec<Entry> {
        self.entries
            .into_iter()
            .filter_map(|(key, tree)| Some((key, tree?)))
            .collect()
    }
}
