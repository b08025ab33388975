//! The few lines of a source that a message shows.
//!
//! A message must cost the same in a file of ten lines and in one of ten million, and on a line of any length. So a
//! source's lines are found once, and what is shown of it for a problem is a text of its own: the lines with labels
//! and their neighbours, the long ones cut to what stands around the labels. Line numbers and columns stay true.

use std::collections::BTreeSet;
use std::ops::Range;

use miette::{LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

use super::Source;
use crate::Span;

/// Lines up to so many bytes are shown whole.
const WHOLE: usize = 160;
/// How much of a longer line is shown on each side of a label, and of a label's own text, in bytes.
const AROUND: usize = 40;
const MARKED: usize = 60;
/// What stands for what is cut.
const CUT: &str = "…";

/// Where the lines of a text begin.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    pub fn of(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        Self {
            starts: std::iter::once(0).chain(ends.map(|(i, _)| i + 1)).collect(),
        }
    }

    /// The line of a byte, from 0.
    pub fn at(&self, byte: usize) -> usize {
        self.starts.partition_point(|start| *start <= byte) - 1
    }

    /// The bytes of a line, without its end.
    fn range(&self, text: &str, line: usize) -> Range<usize> {
        let start = self.starts[line];
        let end = self.starts.get(line + 1).map_or(text.len(), |next| next - 1);
        start..start + text[start..end].trim_end_matches('\r').len()
    }

    /// The column of a byte in its line, from 0, in characters.
    pub fn column(&self, text: &str, byte: usize) -> usize {
        let start = self.starts[self.at(byte)];
        text.get(start..byte).map_or(0, |before| before.chars().count())
    }
}

/// The lines that one problem shows.
#[derive(Debug)]
pub(super) struct Excerpt<'s> {
    name: &'s str,
    pub text: String,
    /// Of every line shown: where it begins in `text`, and its number in the source.
    lines: Vec<(usize, usize)>,
    /// The labels: their place in `text`, the column in the source, the remark.
    labels: Vec<(Range<usize>, usize, &'s str)>,
}

impl<'s> Excerpt<'s> {
    /// The excerpt for these labels, all of this source.
    pub fn new(source: &'s Source, lines: &Lines, labels: &[(Span, &'s str)]) -> Self {
        let text = &source.text;
        let mut places: Vec<(usize, Range<usize>)> = labels
            .iter()
            .map(|(span, _)| {
                let start = floor(text, span.start as usize);
                let line = lines.at(start);
                let end = (start + span.len as usize).min(lines.range(text, line).end).max(start);
                (line, start..floor(text, end).max(start))
            })
            .collect();
        // The empty line that stands after the end of most files is shown only if something is wrong there.
        let last = lines.starts.len() - 1;
        let context_end = last - usize::from(last > 0 && lines.starts[last] == text.len());
        let shown: BTreeSet<usize> = places
            .iter()
            .flat_map(|(line, _)| line.saturating_sub(1)..=(line + 1).min(context_end).max(*line))
            .collect();
        let mut excerpt = Self {
            name: &source.name,
            text: String::new(),
            lines: Vec::new(),
            labels: Vec::new(),
        };
        let mut found = vec![(0..0, 0); places.len()];
        for line in shown {
            let start = excerpt.text.len();
            excerpt.lines.push((start, line));
            let whole = lines.range(text, line);
            let parts = parts(
                text,
                &whole,
                places.iter_mut().filter(|(l, _)| *l == line).map(|(_, r)| r),
            );
            let mut end = whole.start;
            for part in parts {
                if part.start > end {
                    excerpt.text.push_str(CUT);
                }
                for ((at, place), found) in places.iter().zip(&mut found) {
                    if *at == line && part.start <= place.start && place.end <= part.end {
                        let start = excerpt.text.len() + place.start - part.start;
                        *found = (start..start + place.len(), lines.column(text, place.start));
                    }
                }
                excerpt.text.push_str(&text[part.clone()]);
                end = part.end;
            }
            if end < whole.end {
                excerpt.text.push_str(CUT);
            }
            excerpt.text.push('\n');
        }
        excerpt.labels = found
            .into_iter()
            .zip(labels)
            .map(|((place, column), (_, remark))| (place, column, *remark))
            .collect();
        excerpt
    }

    /// The labels, as places in the excerpt.
    pub fn labels(&self) -> impl Iterator<Item = LabeledSpan> {
        self.labels
            .iter()
            .map(|(place, _, remark)| LabeledSpan::new(Some((*remark).to_string()), place.start, place.len().max(1)))
    }
}

/// The last start of a character up to a byte.
fn floor(text: &str, byte: usize) -> usize {
    let mut byte = byte.min(text.len());
    while !text.is_char_boundary(byte) {
        byte -= 1;
    }
    byte
}

/// What is shown of a line: all of a short one, of a long one what stands around its labels, which are cut as well.
fn parts<'r>(text: &str, line: &Range<usize>, labels: impl Iterator<Item = &'r mut Range<usize>>) -> Vec<Range<usize>> {
    if line.len() <= WHOLE {
        return vec![line.clone()];
    }
    let mut parts: Vec<Range<usize>> = labels
        .map(|label| {
            label.end = floor(text, label.end.min(label.start + MARKED)).max(label.start);
            let start = floor(text, label.start.saturating_sub(AROUND)).max(line.start);
            start..floor(text, label.end + AROUND).min(line.end)
        })
        .collect();
    if parts.is_empty() {
        parts.push(line.start..floor(text, line.start + WHOLE));
    }
    parts.sort_by_key(|part| part.start);
    let mut apart: Vec<Range<usize>> = Vec::new();
    for part in parts {
        match apart.last_mut() {
            Some(last) if part.start <= last.end => last.end = last.end.max(part.end),
            _ => apart.push(part),
        }
    }
    apart
}

impl SourceCode for Excerpt<'_> {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let line_at = |byte: usize| self.lines.partition_point(|(start, _)| *start <= byte) - 1;
        let (mut first, mut last) = (line_at(span.offset()), line_at(span.offset() + span.len().max(1) - 1));
        // Lines that are not neighbours in the source are none here.
        for _ in 0..before {
            if first > 0 && self.lines[first - 1].1 + 1 == self.lines[first].1 {
                first -= 1;
            }
        }
        for _ in 0..after {
            if last + 1 < self.lines.len() && self.lines[last].1 + 1 == self.lines[last + 1].1 {
                last += 1;
            }
        }
        let (start, column) = if before == 0 {
            let label = self.labels.iter().find(|(place, ..)| place.start == span.offset());
            (span.offset(), label.map_or(0, |(_, column, _)| *column))
        } else {
            (self.lines[first].0, 0)
        };
        let end = self.lines.get(last + 1).map_or(self.text.len(), |(start, _)| *start);
        let data = self.text.as_bytes().get(start..end).ok_or(MietteError::OutOfBounds)?;
        Ok(Box::new(MietteSpanContents::new_named(
            self.name.to_string(),
            data,
            (start, end - start).into(),
            self.lines[first].1,
            column,
            last - first + 1,
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(text: String) -> Source {
        Source {
            name: "graph.yaml".to_string(),
            text,
        }
    }

    #[test]
    fn what_is_shown_is_small_in_a_file_of_any_size() {
        let source = source("an ordinary line\n".repeat(100_000));
        let lines = Lines::of(&source.text);
        let far = Span {
            source: 0,
            start: 17 * 99_000,
            len: 2,
        };
        let excerpt = Excerpt::new(
            &source,
            &lines,
            &[(far, "here"), (Span { start: 0, ..far }, "and here")],
        );
        assert_eq!(excerpt.text, "an ordinary line\n".repeat(5));
        let contents = excerpt.read_span(&(17 * 3, 2).into(), 1, 1).unwrap();
        assert_eq!((contents.line(), contents.line_count()), (98_999, 3));
    }

    #[test]
    fn a_long_line_is_cut_to_what_stands_around_the_labels() {
        let source = source(format!("{}X{}\n", "é".repeat(500_000), "ü".repeat(500_000)));
        let lines = Lines::of(&source.text);
        let span = Span {
            source: 0,
            start: 1_000_000,
            len: 1_000_001,
        };
        let excerpt = Excerpt::new(&source, &lines, &[(span, "here")]);
        assert!(excerpt.text.len() < 200, "{}", excerpt.text);
        let label = excerpt.labels().next().unwrap();
        assert!(excerpt.text[label.offset()..].starts_with("Xü"));
        assert!(excerpt.text.starts_with("…é") && excerpt.text.ends_with("ü…\n"));
        let contents = excerpt.read_span(label.inner(), 0, 0).unwrap();
        assert_eq!((contents.line(), contents.column()), (0, 500_000));
    }
}
