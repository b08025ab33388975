//! A part of a study as an overlay of a graph, with every mistake told where the study says it.
//!
//! What a variant changes (`set`, `nodes`, …) is written out as a graph file that extends the variant's graph. The text
//! is made; the places in it lead back to the study, so that a misspelt parameter is shown on the line on which the
//! user misspelt it.

use std::fmt::Write;

use gear_graph::graph::Source;
use gear_graph::{Graph, GraphSource, Library, Mistakes, Problem, Registry, Span, Spanned, Tree, TreeKind};

use crate::read::{Entries, Reader};

/// What a variant is made of: a graph and changes to it.
pub struct Overlay<'t> {
    /// The graph that is changed: `@name`, or a path from the folder of the study.
    pub graph: Spanned<String>,
    /// `inputs`, `nodes` and `outputs`, as in a graph file.
    pub sections: Vec<(&'t Spanned<String>, &'t Tree)>,
    /// `NODE.PARAM: VALUE`, in the order in which they apply.
    pub sets: Vec<(&'t Spanned<String>, &'t Tree)>,
}

/// A made text and where its parts come from.
#[derive(Default)]
struct Made {
    text: String,
    /// (start, end, place in the study), inner parts before the outer ones that hold them.
    parts: Vec<(usize, usize, Span)>,
}

impl Overlay<'_> {
    /// Checks the graph of a variant. Mistakes go to the reader; the study is its source 0.
    pub fn check(&self, reader: &mut Reader, study: &str, library: &Library, registry: &Registry) -> Option<Graph> {
        let mut overlay = Made::default();
        overlay.text.push_str("{\"gear\": 1, \"extends\": ");
        overlay.part(self.graph.span, |made| made.string(&self.graph.value));
        for (key, tree) in &self.sections {
            overlay.text.push_str(", ");
            overlay.entry(key, tree);
        }
        overlay.text.push('}');
        let sets: Vec<Made> = self.sets.iter().map(|(key, tree)| Made::set(key, tree)).collect();
        let source = GraphSource {
            name: study.to_owned(),
            text: overlay.text.clone(),
            set: sets.iter().map(|made| made.text.clone()).collect(),
            library: library.clone(),
        };
        match source.check(registry) {
            Ok(graph) => Some(graph),
            Err(mistakes) => {
                let made: Vec<&Made> = std::iter::once(&overlay).chain(&sets).collect();
                adopt(&mistakes, &made, reader, library);
                None
            }
        }
    }
}

/// Takes the errors over, with places in made texts led back to the study.
fn adopt(mistakes: &Mistakes, made: &[&Made], reader: &mut Reader, library: &Library) {
    // The files come first, then each set as a source of its own; the made overlay is the first file.
    let files = mistakes.files().count() as u32;
    let errors = mistakes.problems().iter();
    for problem in errors.filter(|p| p.severity == gear_graph::Severity::Error) {
        let labels = problem.labels.iter().map(|(span, remark)| {
            let span = match span.source {
                0 => made[0].back(*span),
                source if source >= files => made[(source - files + 1) as usize].back(*span),
                _ => elsewhere(mistakes, *span, reader, library),
            };
            (span, remark.clone())
        });
        let problem = Problem {
            labels: labels.collect(),
            ..problem.clone()
        };
        // Variants that share a mistake of the study, or of a graph, tell it once.
        if !reader.problems.contains(&problem) {
            reader.problems.push(problem);
        }
    }
}

/// A place in a file that the graph extends.
fn elsewhere(mistakes: &Mistakes, span: Span, reader: &mut Reader, library: &Library) -> Span {
    let (name, ..) = mistakes.position(span);
    let known = reader.sources.iter().position(|source| source.name == name);
    let source = known.unwrap_or_else(|| {
        let text = library.read(name).map(|text| text.into_owned()).unwrap_or_default();
        reader.sources.push(Source {
            name: name.to_owned(),
            text,
        });
        reader.sources.len() - 1
    });
    Span {
        source: source as u32,
        ..span
    }
}

impl Made {
    fn set(key: &Spanned<String>, tree: &Tree) -> Self {
        let mut made = Self::default();
        made.part(key.span, |made| made.text.push_str(&key.value));
        made.text.push('=');
        made.tree(tree);
        made
    }

    fn part(&mut self, place: Span, write: impl FnOnce(&mut Self)) {
        let start = self.text.len();
        write(self);
        self.parts.push((start, self.text.len(), place));
    }

    fn string(&mut self, text: &str) {
        self.text.push_str(&serde_json::Value::from(text).to_string());
    }

    fn entry(&mut self, key: &Spanned<String>, tree: &Tree) {
        self.part(key.span, |made| made.string(&key.value));
        self.text.push_str(": ");
        self.tree(tree);
    }

    /// YAML in its flow style. The parser limits how deep a tree is.
    fn tree(&mut self, tree: &Tree) {
        self.part(tree.span, |made| match &tree.kind {
            TreeKind::Null => made.text.push_str("null"),
            TreeKind::Bool(truth) => made.text.push_str(if *truth { "true" } else { "false" }),
            TreeKind::Integer(number) => {
                let _ = write!(made.text, "{number}");
            }
            TreeKind::Float(number) if number.is_nan() => made.text.push_str(".nan"),
            TreeKind::Float(number) if number.is_infinite() => {
                made.text.push_str(if *number > 0.0 { ".inf" } else { "-.inf" })
            }
            TreeKind::Float(number) => {
                let _ = write!(made.text, "{number:?}");
            }
            TreeKind::Text(text) => made.string(text),
            TreeKind::List(items) => {
                made.text.push('[');
                for (i, item) in items.iter().enumerate() {
                    made.text.push_str(if i > 0 { ", " } else { "" });
                    made.tree(item);
                }
                made.text.push(']');
            }
            TreeKind::Map(entries) => made.map(entries),
        });
    }

    fn map(&mut self, entries: &Entries) {
        self.text.push('{');
        for (i, (key, tree)) in entries.iter().enumerate() {
            self.text.push_str(if i > 0 { ", " } else { "" });
            self.entry(key, tree);
        }
        self.text.push('}');
    }

    /// Where the study says what stands at a place of this text: the innermost part that holds the place. Within a part
    /// that was taken over as it stood, the very place.
    fn back(&self, span: Span) -> Span {
        let at = span.start as usize;
        let holding = self.parts.iter().find(|(start, end, _)| *start <= at && at < *end);
        let nearest = || self.parts.iter().rev().find(|(start, ..)| *start <= at);
        let Some((start, end, place)) = holding.or_else(nearest).or(self.parts.first()) else {
            return Span::default();
        };
        let within = at.saturating_sub(*start) as u32;
        if end - start != place.len as usize || within >= place.len {
            return *place;
        }
        Span {
            start: place.start + within,
            len: span.len.min(place.len - within),
            ..*place
        }
    }
}
