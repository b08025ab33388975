//! Words, and methods with parameters of their own.

use serde::Serialize;

use super::{ParamSpec, ParamValue, ParamValues};

/// One choice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Variant {
    /// The word in graph files.
    pub name: &'static str,
    /// The doc comment.
    pub doc: &'static str,
    /// Parameters of its own.
    pub params: Vec<ParamSpec>,
}

/// The externally tagged form of a method with parameters: `{name: {…}}`.
pub fn tagged(name: &str, values: ParamValues) -> ParamValue {
    ParamValue::Object(ParamValues::from_iter([(name.to_string(), ParamValue::Object(values))]))
}
