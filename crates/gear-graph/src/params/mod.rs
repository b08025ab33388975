//! Parameters: described, read from a graph file with positions, written for the key.

mod builtin;
mod choice;
mod described;
mod fields;
mod limits;
mod problem;
mod tree;

pub use builtin::OrAuto;
pub use choice::{Variant, tagged};
pub use fields::{Fields, Reader};
pub(crate) use fields::{unknown_parameter, yaml_trap};
pub use limits::{Bound, Limits};
pub use problem::{Problem, Severity, Span, Spanned};
pub use tree::{Tree, TreeKind};

use std::fmt::Debug;

use serde::Serialize;

/// A parameter's value as JSON: how it is shown, compared and hashed.
pub type ParamValue = serde_json::Value;

/// Parameters by name, defaults filled in.
pub type ParamValues = serde_json::Map<String, ParamValue>;

/// Parameters of a node, a loader or a method; derived.
pub trait Params: Sized + Clone + Debug + Send + Sync + 'static {
    /// The doc comment of the struct.
    const DOC: &'static str;

    /// The parameters, in order.
    fn specs() -> Vec<ParamSpec>;

    /// Reads them, and says nothing of other keys: these may belong to parameters that stand beside them.
    fn take(fields: &mut Fields<'_, '_>) -> Option<Self>;

    /// Reads them. Every mistake goes to `fields`; the result is `None` if a value could not be read.
    fn read(fields: &mut Fields<'_, '_>) -> Option<Self> {
        let read = Self::take(fields);
        fields.finish();
        read
    }

    /// All of them, as values.
    fn write(&self) -> ParamValues;
}

/// One parameter, as its definition describes it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParamSpec {
    /// The name in graph files.
    pub name: &'static str,
    /// The doc comment.
    pub doc: &'static str,
    /// What it takes.
    pub kind: ParamKind,
    /// Range and unit.
    pub limits: Limits,
    /// The value when it is not given; `None` if it must be given.
    pub default: Option<ParamValue>,
}

/// What a parameter takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ParamKind {
    /// `true` or `false`.
    Bool,
    /// A whole number.
    Integer,
    /// A finite number.
    Number,
    /// A text.
    Text,
    /// One of several words, or methods with parameters of their own.
    Choice {
        /// The words.
        variants: Vec<Variant>,
    },
    /// A list.
    List {
        /// What its elements are.
        of: Box<ParamKind>,
        /// How many, if that is fixed.
        len: Option<usize>,
    },
    /// The word `auto`, or a value.
    OrAuto {
        /// The value.
        of: Box<ParamKind>,
    },
    /// `null`, or a value.
    Optional {
        /// The value.
        of: Box<ParamKind>,
    },
}

impl ParamKind {
    /// The parameters of a method that it takes.
    pub fn method(&self, name: &str) -> Option<&[ParamSpec]> {
        match self {
            Self::Choice { variants } => {
                let method = variants.iter().find(|variant| variant.name == name)?;
                Some(&method.params)
            }
            Self::OrAuto { of } | Self::Optional { of } => of.method(name),
            _ => None,
        }
    }

    /// The kind in words, such as `a number` or `one of relief, figure`.
    pub fn describe(&self) -> String {
        match self {
            Self::Bool => "true or false".into(),
            Self::Integer => "a whole number".into(),
            Self::Number => "a number".into(),
            Self::Text => "a text".into(),
            Self::Choice { variants } => {
                let names: Vec<_> = variants.iter().map(|v| v.name).collect();
                format!("one of {}", names.join(", "))
            }
            Self::List { of, len: None } => format!("a list, each {}", of.describe()),
            Self::List { of, len: Some(n) } => format!("a list of {n}, each {}", of.describe()),
            Self::OrAuto { of } => format!("{}, or auto", of.describe()),
            Self::Optional { of } => format!("{}, or null", of.describe()),
        }
    }
}

/// A type that may stand as a parameter: numbers, booleans, texts, lists, options, [`OrAuto`], and enums that derive
/// [`crate::Choice`].
pub trait Param: Clone + Sized {
    /// What it takes.
    fn kind() -> ParamKind;

    /// The range that its type has by itself, whatever its definition says.
    fn bounds() -> Limits {
        Limits::none()
    }

    /// Reads it, or tells `reader` why not.
    fn read(tree: &Tree, limits: &Limits, reader: &mut Reader<'_>) -> Option<Self>;

    /// The value, in the form in which it is read.
    fn write(&self) -> ParamValue;
}

#[cfg(test)]
mod tests;
