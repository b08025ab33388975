//! A YAML value with the place of everything in it.

use super::{ParamValue, Span, Spanned};

/// A YAML value and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// Where it stands.
    pub span: Span,
    /// What it is.
    pub kind: TreeKind,
}

/// What a YAML value is.
#[derive(Clone, Debug, PartialEq)]
pub enum TreeKind {
    /// Nothing, `null` or `~`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// Another number; may be infinite or NaN.
    Float(f64),
    /// A text, also what YAML 1.1 took for something else (`no`, `012`, `1_000`).
    Text(String),
    /// A list.
    List(Vec<Tree>),
    /// A map in the order of the file; keys may repeat.
    Map(Vec<(Spanned<String>, Tree)>),
}

impl Tree {
    /// What was found, in words, for messages.
    pub fn describe(&self) -> String {
        match &self.kind {
            TreeKind::Null => "nothing".into(),
            TreeKind::Bool(b) => format!("`{b}`"),
            TreeKind::Integer(i) => format!("`{i}`"),
            TreeKind::Float(f) if f.is_finite() && f.abs() >= 1e15 => format!("`{f:e}`"),
            // `1.0` is no whole number, and must not look like one.
            TreeKind::Float(f) if f.fract() == 0.0 => format!("`{f:.1}`"),
            TreeKind::Float(f) => format!("`{f}`"),
            TreeKind::Text(text) => format!("the text `{text}`"),
            TreeKind::List(items) if items.is_empty() => "an empty list".into(),
            TreeKind::List(items) => format!("a list of {}", items.len()),
            TreeKind::Map(entries) if entries.is_empty() => "an empty map".into(),
            TreeKind::Map(_) => "a map".into(),
        }
    }

    /// A tree without places, from JSON.
    pub fn from_json(value: &ParamValue) -> Self {
        let kind = match value {
            ParamValue::Null => TreeKind::Null,
            ParamValue::Bool(b) => TreeKind::Bool(*b),
            ParamValue::Number(n) => match n.as_i64() {
                Some(i) => TreeKind::Integer(i),
                None => TreeKind::Float(n.as_f64().unwrap_or(f64::NAN)),
            },
            ParamValue::String(text) => TreeKind::Text(text.clone()),
            ParamValue::Array(items) => TreeKind::List(items.iter().map(Self::from_json).collect()),
            ParamValue::Object(fields) => TreeKind::Map(
                fields
                    .iter()
                    .map(|(key, value)| {
                        let key = Spanned {
                            value: key.clone(),
                            span: Span::default(),
                        };
                        (key, Self::from_json(value))
                    })
                    .collect(),
            ),
        };
        Self {
            span: Span::default(),
            kind,
        }
    }
}
