//! YAML text → [`Tree`].
//!
//! The reader is strict where YAML 1.1 and 1.2 differ (`no`, `012`, `1_000` are texts), keeps keys that repeat so
//! that each can be shown, and stops at a budget, so that an alias bomb is a message and not an outage.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Error;
use serde_saphyr::budget::BudgetBreach;
use serde_saphyr::options::{DuplicateKeyPolicy, NonFiniteFloatPolicy};

use super::plain;
use crate::{Problem, Span, Spanned, Tree, TreeKind};

/// A node of the file as serde delivers it; its place comes from the `Spanned` around it.
enum Raw {
    Null,
    Bool(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    List(Vec<serde_saphyr::Spanned<Raw>>),
    Map(Vec<(serde_saphyr::Spanned<String>, serde_saphyr::Spanned<Raw>)>),
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RawVisitor)
    }
}

struct RawVisitor;

impl<'de> Visitor<'de> for RawVisitor {
    type Value = Raw;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a YAML value")
    }

    fn visit_unit<E>(self) -> Result<Raw, E> {
        Ok(Raw::Null)
    }

    fn visit_none<E>(self) -> Result<Raw, E> {
        Ok(Raw::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Raw, E> {
        Ok(Raw::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Raw, E> {
        Ok(Raw::Integer(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Raw, E> {
        Ok(i64::try_from(value).map_or(Raw::Float(value as f64), Raw::Integer))
    }

    fn visit_i128<E>(self, value: i128) -> Result<Raw, E> {
        Ok(Raw::Float(value as f64))
    }

    fn visit_u128<E>(self, value: u128) -> Result<Raw, E> {
        Ok(Raw::Float(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Raw, E> {
        Ok(Raw::Float(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Raw, E> {
        Ok(Raw::Text(value.to_string()))
    }

    fn visit_string<E>(self, value: String) -> Result<Raw, E> {
        Ok(Raw::Text(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Raw, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Raw::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Raw, A::Error> {
        let mut map = Vec::new();
        while let Some(entry) = entries.next_entry()? {
            map.push(entry);
        }
        Ok(Raw::Map(map))
    }
}

/// Reads the text of source number `source`.
pub fn parse(text: &str, source: u32, problems: &mut Vec<Problem>) -> Option<Tree> {
    plain::parse(text, source).or_else(|| parse_any(text, source, problems))
}

/// Reads whatever is YAML.
pub(super) fn parse_any(text: &str, source: u32, problems: &mut Vec<Problem>) -> Option<Tree> {
    let options = serde_saphyr::options! {
        strict_booleans: true,
        leading_zero_numbers_as_strings: true,
        underscored_numbers_as_strings: true,
        duplicate_keys: DuplicateKeyPolicy::PassThrough,
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
        // Room for graphs of 100,000 nodes; a bomb of aliases stops at the same place as a large file.
        budget: serde_saphyr::budget! {
            max_nodes: 4_000_000,
            max_events: 16_000_000,
            max_depth: 64,
        },
    };
    match serde_saphyr::from_str_with_options::<serde_saphyr::Spanned<Raw>>(text, options) {
        Ok(raw) => Some(place(raw, source, text)),
        Err(error) => {
            problems.push(problem(&error, source, text));
            None
        }
    }
}

fn problem(error: &Error, source: u32, text: &str) -> Problem {
    let span = error.location().map_or(
        Span {
            source,
            ..Span::default()
        },
        |location| span(&location, source, text),
    );
    let mut error = error.without_snippet();
    while let Error::AliasError { error: inner, .. } = error {
        error = inner.without_snippet();
    }
    let large = |message: &str, help: &str| Problem::error("too-large", message, span, "too much here").help(help);
    match error {
        Error::Budget {
            breach: BudgetBreach::Depth { .. },
            ..
        } => return large("the file is nested too deeply", "a graph needs few levels"),
        Error::Budget { .. }
        | Error::AliasReplayCounterOverflow { .. }
        | Error::AliasReplayLimitExceeded { .. }
        | Error::AliasExpansionLimitExceeded { .. }
        | Error::AliasReplayStackDepthExceeded { .. } => {
            return large(
                "the file unfolds to more than can be read",
                "aliases (`*name`) that hold aliases multiply; write out what is meant",
            );
        }
        _ => {}
    }
    let message = error.to_string();
    // The place is shown; it need not be told as well.
    let message = message.lines().next().and_then(|line| line.split(" at line ").next());
    let message = message.unwrap_or_default();
    if message.contains("recursion limit") {
        return large("the file is nested too deeply", "a graph needs few levels");
    }
    let found = text.get(span.start as usize..).and_then(|rest| rest.chars().next());
    let (what, help) = match error {
        Error::MultipleDocuments { .. } => (
            "a second document begins",
            Some("a file holds one graph; remove the line `---` and what follows".to_owned()),
        ),
        Error::NullIntoString { .. } | Error::Unexpected { .. } => {
            ("a key must be a text", Some("write a name before the colon".to_owned()))
        }
        Error::RecursiveReferencesRequireWeakTypes { .. } => (
            "an anchor holds itself",
            Some("`*name` cannot stand within what `&name` marks".to_owned()),
        ),
        Error::UnknownAnchor { .. } => (
            "there is no anchor of that name",
            Some("`*name` repeats what `&name` marks further up".to_owned()),
        ),
        _ if message.contains("tabs disallowed") => (
            "a tab stands where the line is indented",
            Some("indent with spaces".to_owned()),
        ),
        _ => (
            message,
            found
                .filter(|found| matches!(found, '@' | '`' | '%'))
                .map(|found| format!("a text that begins with {found} needs quotes around it")),
        ),
    };
    Problem::error(
        "not-yaml",
        format!("this is not YAML that can be read: {what}"),
        span,
        "here",
    )
    .maybe_help(help)
}

fn place(raw: serde_saphyr::Spanned<Raw>, source: u32, text: &str) -> Tree {
    let span = span(&raw.referenced, source, text);
    let kind = match raw.value {
        Raw::Null => TreeKind::Null,
        Raw::Bool(value) => TreeKind::Bool(value),
        Raw::Integer(value) => TreeKind::Integer(value),
        Raw::Float(value) => TreeKind::Float(value),
        Raw::Text(value) => TreeKind::Text(value),
        Raw::List(items) => TreeKind::List(items.into_iter().map(|item| place(item, source, text)).collect()),
        Raw::Map(entries) => TreeKind::Map(
            entries
                .into_iter()
                .map(|(key, value)| {
                    let key = Spanned {
                        span: self::span(&key.referenced, source, text),
                        value: key.value,
                    };
                    (key, place(value, source, text))
                })
                .collect(),
        ),
    };
    Tree { span, kind }
}

/// The bytes of a location, cut at the end of its first line so that labels stay short.
fn span(location: &serde_saphyr::Location, source: u32, text: &str) -> Span {
    let start = match location.span().byte_offset() {
        Some(offset) => offset.min(text.len() as u64) as usize,
        None => offset_of(text, location.line(), location.column()),
    };
    let len = location.span().byte_len().unwrap_or(0).min((text.len() - start) as u64) as usize;
    let first_line = text
        .get(start..start + len)
        .and_then(|t| t.lines().next())
        .map_or(0, |line| line.trim_end().len());
    Span {
        source,
        start: start as u32,
        len: first_line as u32,
    }
}

/// The byte at a line and column (both from 1).
fn offset_of(text: &str, line: u64, column: u64) -> usize {
    let before: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1) as usize)
        .map(str::len)
        .sum();
    let rest = &text[before..];
    let in_line = rest
        .char_indices()
        .nth(column.saturating_sub(1) as usize)
        .map_or(rest.len(), |(i, _)| i);
    before + in_line
}

/// Reports keys that repeat, everywhere in the tree.
pub fn duplicate_keys(tree: &Tree, problems: &mut Vec<Problem>) {
    let mut stack = vec![tree];
    while let Some(tree) = stack.pop() {
        match &tree.kind {
            TreeKind::List(items) => stack.extend(items.iter().rev()),
            TreeKind::Map(entries) => {
                let mut seen = std::collections::HashMap::with_capacity(entries.len());
                for (key, value) in entries {
                    stack.push(value);
                    if let Some(first) = seen.insert(key.value.as_str(), key.span) {
                        problems.push(
                            Problem::error(
                                "duplicate-key",
                                format!("the key `{}` stands twice in one map", key.value),
                                key.span,
                                "again here",
                            )
                            .label(first, "first here")
                            .help("remove one of them"),
                        );
                    }
                }
            }
            _ => {}
        }
    }
}
