//! Reading what people write: maps with known keys, every mistake with its place.
//!
//! A [`Reader`] gathers mistakes over the files of one study (the study itself is source 0, a manifest the next), so
//! that all of them are told at once, as those of graphs are.

use gear_graph::graph::{Source, nearest, read_yaml};
use gear_graph::{Mistakes, Problem, Span, Spanned, Tree, TreeKind};

/// Entries of a map in the order of the file.
pub type Entries = [(Spanned<String>, Tree)];

/// Gathers sources and what is wrong with them.
#[derive(Default)]
pub struct Reader {
    /// The texts that places point into.
    pub sources: Vec<Source>,
    /// What is wrong.
    pub problems: Vec<Problem>,
}

impl Reader {
    /// Adds a text; the number that places in it have.
    pub fn source(&mut self, name: impl Into<String>, text: impl Into<String>) -> u32 {
        self.sources.push(Source {
            name: name.into(),
            text: text.into(),
        });
        self.sources.len() as u32 - 1
    }

    /// Reads a YAML file.
    pub fn yaml(&mut self, name: &str, text: &str) -> Option<Tree> {
        let source = self.source(name, text);
        read_yaml(text, source, &mut self.problems)
    }

    /// All mistakes.
    pub fn mistakes(self) -> Mistakes {
        Mistakes::new(self.sources, self.problems)
    }

    /// Whether nothing is wrong so far.
    pub fn clean(&self) -> bool {
        self.problems.is_empty()
    }

    /// Reports an error.
    pub fn error(
        &mut self,
        code: &'static str,
        message: impl Into<String>,
        span: Span,
        label: &str,
        help: Option<String>,
    ) {
        self.problems
            .push(Problem::error(code, message, span, label).maybe_help(help));
    }

    /// A map, or a mistake.
    pub fn map<'t>(&mut self, tree: &'t Tree, what: &str) -> Option<&'t Entries> {
        match &tree.kind {
            TreeKind::Map(entries) => Some(entries),
            _ => {
                let message = format!("{what} must be a map, found {}", tree.describe());
                self.error("wrong-type", message, tree.span, "expected a map", None);
                None
            }
        }
    }

    /// A map with these keys only.
    pub fn keys(&mut self, entries: &Entries, what: &str, known: &[&str]) {
        for (key, _) in entries.iter().filter(|(key, _)| !known.contains(&key.value.as_str())) {
            let help = did_you_mean(&key.value, known.iter().copied());
            let help = help.unwrap_or_else(|| format!("its keys are {}", known.join(", ")));
            let message = format!("{what} has no key `{}`", key.value);
            self.error("unknown-key", message, key.span, "unknown key", Some(help));
        }
    }

    /// A text, or a mistake.
    pub fn text<'t>(&mut self, tree: &'t Tree, what: &str, expected: &str) -> Option<&'t str> {
        match &tree.kind {
            TreeKind::Text(text) => Some(text),
            _ => {
                self.expected(tree, what, expected);
                None
            }
        }
    }

    /// A text or a number as text, or a mistake.
    pub fn word(&mut self, tree: &Tree, what: &str) -> Option<String> {
        match &tree.kind {
            TreeKind::Text(text) => Some(text.clone()),
            TreeKind::Integer(number) => Some(number.to_string()),
            TreeKind::Float(number) => Some(number.to_string()),
            TreeKind::Bool(truth) => Some(truth.to_string()),
            _ => {
                self.expected(tree, what, "a text");
                None
            }
        }
    }

    /// A finite number, or a mistake.
    pub fn number(&mut self, tree: &Tree, what: &str) -> Option<f64> {
        match tree.kind {
            TreeKind::Integer(number) => Some(number as f64),
            TreeKind::Float(number) if number.is_finite() => Some(number),
            _ => {
                self.expected(tree, what, "a number");
                None
            }
        }
    }

    /// A whole number within limits, or a mistake.
    pub fn count(&mut self, tree: &Tree, what: &str, range: std::ops::RangeInclusive<i64>) -> Option<usize> {
        match tree.kind {
            TreeKind::Integer(number) if range.contains(&number) => usize::try_from(number).ok(),
            _ => {
                let expected = format!("a whole number from {} to {}", range.start(), range.end());
                self.expected(tree, what, &expected);
                None
            }
        }
    }

    /// One of some words, or a mistake.
    pub fn one_of<'t>(&mut self, tree: &'t Tree, what: &str, words: &[&str]) -> Option<&'t str> {
        let text = self.text(tree, what, &format!("one of {}", words.join(", ")))?;
        if words.contains(&text) {
            return Some(text);
        }
        let help = did_you_mean(text, words.iter().copied());
        let help = help.unwrap_or_else(|| format!("it is one of {}", words.join(", ")));
        let message = format!("{what} cannot be `{text}`");
        self.error("unknown-choice", message, tree.span, "no such choice", Some(help));
        None
    }

    /// One item, or the items of a list.
    pub fn list<'t>(&mut self, tree: &'t Tree) -> Vec<&'t Tree> {
        match &tree.kind {
            TreeKind::List(items) => items.iter().collect(),
            _ => vec![tree],
        }
    }

    /// Texts: one, or a list of them.
    pub fn words(&mut self, tree: &Tree, what: &str) -> Vec<Spanned<String>> {
        let mut words = Vec::new();
        for item in self.list(tree) {
            if let Some(value) = self.word(item, what) {
                words.push(Spanned { value, span: item.span });
            }
        }
        words
    }

    /// Reports a value of the wrong kind.
    pub fn expected(&mut self, tree: &Tree, what: &str, expected: &str) {
        let message = format!("{what} takes {expected}, found {}", tree.describe());
        self.error("wrong-type", message, tree.span, &format!("expected {expected}"), None);
    }
}

/// The value of a key; the last one if it stands twice.
pub fn get<'t>(entries: &'t Entries, key: &str) -> Option<&'t Tree> {
    entries.iter().rev().find(|(k, _)| k.value == key).map(|(_, tree)| tree)
}

/// `did you mean …?`, if a name is near.
pub fn did_you_mean<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(word, names).map(|near| format!("did you mean `{near}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mistake_of_a_map_is_told_with_its_place() {
        let mut reader = Reader::default();
        let tree = reader.yaml("my.yaml", "seeed: 1\nname: [1]\nsize: 0\n").unwrap();
        let entries = reader.map(&tree, "a thing").unwrap().to_vec();
        reader.keys(&entries, "a thing", &["seed", "name", "size"]);
        assert_eq!(reader.text(get(&entries, "name").unwrap(), "`name`", "a text"), None);
        assert_eq!(reader.count(get(&entries, "size").unwrap(), "`size`", 1..=9), None);
        let mistakes = reader.mistakes();
        let text = mistakes.render(false);
        assert_eq!(mistakes.problems().len(), 3, "{text}");
        assert!(
            text.contains("did you mean `seed`?") && text.contains("my.yaml:1:1"),
            "{text}"
        );
        assert!(text.contains("a whole number from 1 to 9, found `0`"), "{text}");
    }
}
