//! All mistakes of a graph file, shown like a compiler shows them.

use std::fmt;

use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource, SourceCode};

use crate::{Problem, Severity, Span};

/// A text that problems point into.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Its name in messages.
    pub name: String,
    /// The text.
    pub text: String,
}

/// What is wrong with a graph file and its overrides; may also hold warnings, or nothing.
#[derive(Clone, Default)]
pub struct Mistakes {
    sources: Vec<Source>,
    problems: Vec<Problem>,
}

impl Mistakes {
    /// Problems with the texts they point into, in the order of their places.
    pub fn new(sources: Vec<Source>, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.labels.first().map(|(span, _)| *span));
        Self { sources, problems }
    }

    /// The problems.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Whether the graph cannot run.
    pub fn has_errors(&self) -> bool {
        self.problems.iter().any(|p| p.severity == Severity::Error)
    }

    /// Line and column (from 1) of a place, and the name of its source.
    pub fn position(&self, span: Span) -> (&str, usize, usize) {
        let Some(source) = self.sources.get(span.source as usize) else {
            return ("", 1, 1);
        };
        let before = source.text.get(..span.start as usize).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        (&source.name, line, column)
    }

    /// The text that is shown to the user, `colour` for a terminal.
    pub fn render(&self, colour: bool) -> String {
        let theme = if colour {
            GraphicalTheme::unicode()
        } else {
            GraphicalTheme::unicode_nocolor()
        };
        let handler = GraphicalReportHandler::new_themed(theme)
            .with_width(100)
            .with_context_lines(1);
        let mut text = String::new();
        for problem in &self.problems {
            if !text.is_empty() {
                text.push('\n');
            }
            let shown = Shown::new(problem, &self.sources);
            // Writing to a String cannot fail.
            let _ = handler.render_report(&mut text, &shown);
        }
        text
    }

    /// The same for editors: a list of objects with `code`, `severity`, `message`, `help` and `labels`.
    pub fn to_json(&self) -> serde_json::Value {
        self.problems
            .iter()
            .map(|problem| {
                let labels: Vec<_> = problem
                    .labels
                    .iter()
                    .map(|(span, remark)| {
                        let (file, line, column) = self.position(*span);
                        serde_json::json!({
                            "file": file, "line": line, "column": column, "offset": span.start, "length": span.len,
                            "remark": remark,
                        })
                    })
                    .collect();
                serde_json::json!({
                    "code": problem.code, "severity": problem.severity, "message": problem.message,
                    "help": problem.help, "labels": labels,
                })
            })
            .collect()
    }
}

impl fmt::Debug for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for Mistakes {}

/// One problem as miette sees it.
struct Shown<'a> {
    problem: &'a Problem,
    source: Option<NamedSource<String>>,
}

impl<'a> Shown<'a> {
    fn new(problem: &'a Problem, sources: &'a [Source]) -> Self {
        let source = problem
            .labels
            .first()
            .and_then(|(span, _)| sources.get(span.source as usize))
            .map(|source| NamedSource::new(&source.name, source.text.clone()));
        Self { problem, source }
    }
}

impl fmt::Debug for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl std::error::Error for Shown<'_> {}

impl miette::Diagnostic for Shown<'_> {
    fn code<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        Some(Box::new(self.problem.code))
    }

    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.problem.severity {
            Severity::Warning => miette::Severity::Warning,
            Severity::Error => miette::Severity::Error,
        })
    }

    fn help<'b>(&'b self) -> Option<Box<dyn fmt::Display + 'b>> {
        self.problem
            .help
            .as_ref()
            .map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.source.as_ref().map(|source| source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let source = self.problem.labels.first()?.0.source;
        let labels = self
            .problem
            .labels
            .iter()
            .filter(move |(span, _)| span.source == source)
            .map(|(span, remark)| {
                LabeledSpan::new(Some(remark.clone()), span.start as usize, (span.len as usize).max(1))
            });
        Some(Box::new(labels))
    }
}
