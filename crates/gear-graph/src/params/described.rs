//! Parameters that are known by their description alone: those of a node that is no Rust type.
//!
//! They are read and written as the derived ones are, with the same messages, so that nobody sees from a graph what a
//! node is made of.

use super::{Fields, Limits, Param, ParamKind, ParamSpec, ParamValue, ParamValues, Reader, Tree, TreeKind, tagged};

impl Fields<'_, '_> {
    /// Reads all of these parameters, defaults filled in, and reports every other key. `None` if one could not be read.
    pub fn take_described(&mut self, specs: &[ParamSpec]) -> Option<ParamValues> {
        let mut values = ParamValues::new();
        let mut complete = true;
        for spec in specs {
            let read = |tree: &Tree, reader: &mut Reader<'_>| value(&spec.kind, &spec.limits, tree, reader);
            match self.take_with(spec.name, &spec.kind, spec.default.clone(), read) {
                Some(value) => {
                    values.insert(spec.name.to_owned(), value);
                }
                None => complete = false,
            }
        }
        self.finish();
        complete.then_some(values)
    }
}

/// Reads one value of this kind; it comes in the form in which the derived parameters write it.
fn value(kind: &ParamKind, limits: &Limits, tree: &Tree, reader: &mut Reader<'_>) -> Option<ParamValue> {
    match kind {
        ParamKind::Bool => bool::read(tree, limits, reader).map(|read| read.write()),
        ParamKind::Integer => i64::read(tree, limits, reader).map(|read| read.write()),
        ParamKind::Number => f64::read(tree, limits, reader).map(|read| read.write()),
        ParamKind::Text => String::read(tree, limits, reader).map(|read| read.write()),
        ParamKind::List { of, len } => match &tree.kind {
            TreeKind::List(items) if len.is_none_or(|len| len == items.len()) => {
                // Every element is read before giving up, so that all mistakes are reported at once.
                let read: Vec<_> = items.iter().map(|item| value(of, limits, item, reader)).collect();
                read.into_iter().collect::<Option<Vec<_>>>().map(ParamValue::Array)
            }
            _ => {
                reader.wrong_kind(tree, &kind.describe());
                None
            }
        },
        ParamKind::OrAuto { of } => match &tree.kind {
            TreeKind::Text(word) if word == "auto" => Some("auto".into()),
            TreeKind::Text(_) | TreeKind::Null | TreeKind::Bool(_) | TreeKind::Map(_)
                if matches!(**of, ParamKind::Number | ParamKind::Integer) =>
            {
                reader.wrong_kind(tree, &kind.describe());
                None
            }
            _ => value(of, limits, tree, reader),
        },
        ParamKind::Optional { of } => match tree.kind {
            TreeKind::Null => Some(ParamValue::Null),
            _ => value(of, limits, tree, reader),
        },
        ParamKind::Choice { variants } => reader.choice(tree, variants, |word, fields| {
            let variant = variants.iter().find(|variant| variant.name == word)?;
            let values = fields.take_described(&variant.params)?;
            Some(if variant.params.is_empty() {
                word.into()
            } else {
                tagged(word, values)
            })
        }),
    }
}
