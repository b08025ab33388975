//! All mistakes of a graph file, shown like a compiler shows them.

use std::fmt;

use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, SourceCode};

use super::excerpt::{Excerpt, Lines};
use super::suggest::clip;
use crate::{Problem, Severity, Span};

/// The name of an override in messages.
pub(super) const SET: &str = "--set";

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
    /// The lines of each source.
    lines: Vec<Lines>,
    problems: Vec<Problem>,
}

impl Mistakes {
    /// Problems with the texts they point into, in the order of their places. What they quote is cut to a length
    /// that can be read.
    pub fn new(sources: Vec<Source>, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.labels.first().map(|(span, _)| *span));
        for problem in &mut problems {
            clip(&mut problem.message);
            if let Some(help) = &mut problem.help {
                clip(help);
            }
            for (_, remark) in &mut problem.labels {
                clip(remark);
            }
        }
        // What points nowhere needs no texts.
        let sources = if problems.is_empty() { Vec::new() } else { sources };
        let lines = sources.iter().map(|source| Lines::of(&source.text)).collect();
        Self {
            sources,
            lines,
            problems,
        }
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

    /// The names of the files that were read, if there is a mistake.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let names = self.sources.iter().map(|source| source.name.as_str());
        names.filter(|name| *name != SET)
    }

    /// Line and column (from 1) of a place, and the name of its source.
    pub fn position(&self, span: Span) -> (&str, usize, usize) {
        let Some(source) = self.sources.get(span.source as usize) else {
            return ("", 1, 1);
        };
        let (lines, start) = (&self.lines[span.source as usize], span.start as usize);
        let (line, column) = (lines.at(start) + 1, lines.column(&source.text, start) + 1);
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
            let shown = Shown::new(problem, self);
            // Writing to a String cannot fail.
            let _ = handler.render_report(&mut text, &shown);
        }
        text
    }

    /// The same for editors: a list of objects with `code`, `severity`, `message`, `help`, the place (`file`, `start`,
    /// `end`) and `labels`, which are all places with a remark each, the main one first. Lines and columns count from
    /// 1, columns in characters; `offset` counts bytes from 0; `end` is the place behind the last character.
    pub fn to_json(&self) -> serde_json::Value {
        self.problems
            .iter()
            .map(|problem| {
                let labels: Vec<_> = problem
                    .labels
                    .iter()
                    .map(|(span, remark)| {
                        let mut place = self.place(*span);
                        place["remark"] = remark.as_str().into();
                        place
                    })
                    .collect();
                let main = problem.labels.first().map(|(span, _)| self.place(*span));
                let at = |key: &str| main.as_ref().map(|place| place[key].clone());
                serde_json::json!({
                    "code": problem.code, "severity": problem.severity, "message": problem.message,
                    "help": problem.help, "file": at("file"), "start": at("start"), "end": at("end"),
                    "labels": labels,
                })
            })
            .collect()
    }

    fn place(&self, span: Span) -> serde_json::Value {
        let point = |offset: u32| {
            let (_, line, column) = self.position(Span { start: offset, ..span });
            serde_json::json!({"line": line, "column": column, "offset": offset})
        };
        let (file, ..) = self.position(span);
        serde_json::json!({"file": file, "start": point(span.start), "end": point(span.start + span.len)})
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
    excerpt: Excerpt<'a>,
}

impl<'a> Shown<'a> {
    fn new(problem: &'a Problem, mistakes: &'a Mistakes) -> Self {
        let mut excerpt = Excerpt::default();
        let mut shown: Vec<u32> = Vec::new();
        for (span, _) in &problem.labels {
            if shown.contains(&span.source) {
                continue;
            }
            shown.push(span.source);
            let number = span.source as usize;
            let Some(source) = mistakes.sources.get(number) else {
                continue;
            };
            let labels: Vec<_> = problem
                .labels
                .iter()
                .filter(|(other, _)| other.source == span.source)
                .map(|(span, remark)| (*span, remark.as_str()))
                .collect();
            excerpt.add(source, &mistakes.lines[number], &labels);
        }
        Self { problem, excerpt }
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
        (!self.excerpt.text.is_empty()).then_some(&self.excerpt as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        Some(Box::new(self.excerpt.labels()))
    }
}
