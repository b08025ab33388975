//! The few lines of a source that a message shows.
//!
//! A message must cost the same in a file of ten lines and in one of ten million, and on a line of any length. So a
//! source's lines are found once, and what is shown of it for a problem is a text of its own: the lines with labels
//! and their neighbours, the long ones cut to what stands around the labels. Line numbers and columns stay true.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;

use miette::{LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

use super::Source;
use super::suggest::shows;
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
        let bytes = text.as_bytes();
        // YAML also ends lines as the first Macintosh did.
        let ends =
            (0..bytes.len()).filter(|i| bytes[*i] == b'\n' || (bytes[*i] == b'\r' && bytes.get(i + 1) != Some(&b'\n')));
        // A byte order mark belongs to no line.
        let first = if text.starts_with('\u{feff}') {
            '\u{feff}'.len_utf8()
        } else {
            0
        };
        Self {
            starts: std::iter::once(first).chain(ends.map(|i| i + 1)).collect(),
        }
    }

    /// The line of a byte, from 0.
    pub fn at(&self, byte: usize) -> usize {
        self.starts.partition_point(|start| *start <= byte).saturating_sub(1)
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

/// The lines that one problem shows, source by source.
#[derive(Debug, Default)]
pub(super) struct Excerpt<'s> {
    pub text: String,
    lines: Vec<Shown<'s>>,
    /// The labels: their place in `text`, the column in the source, the remark.
    labels: Vec<(Range<usize>, usize, &'s str)>,
}

/// A line that is shown.
#[derive(Debug)]
struct Shown<'s> {
    /// Where it begins in the excerpt.
    start: usize,
    /// Its number in its source, from 0.
    number: usize,
    /// The name of its source.
    source: &'s str,
}

impl Shown<'_> {
    /// Whether `next` is the line below.
    fn is_above(&self, next: &Self) -> bool {
        self.number + 1 == next.number && std::ptr::eq(self.source, next.source)
    }
}

impl<'s> Excerpt<'s> {
    /// Adds the lines for these labels, all of this source.
    pub fn add(&mut self, source: &'s Source, lines: &Lines, labels: &[(Span, &'s str)]) {
        let text = &source.text;
        let mut places: Vec<(usize, Range<usize>)> = labels
            .iter()
            .map(|(span, _)| {
                let start = floor(text, span.start as usize);
                let line = lines.at(start);
                let start = start.max(lines.starts[line]);
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
        let mut found = vec![(0..0, 0); places.len()];
        for line in shown {
            self.lines.push(Shown {
                start: self.text.len(),
                number: line,
                source: &source.name,
            });
            let whole = lines.range(text, line);
            let parts = parts(
                text,
                &whole,
                places.iter_mut().filter(|(l, _)| *l == line).map(|(_, r)| r),
            );
            let mut end = whole.start;
            for part in parts {
                if part.start > end {
                    self.text.push_str(CUT);
                }
                for ((at, place), found) in places.iter().zip(&mut found) {
                    if *at == line && part.start <= place.start && place.end <= part.end {
                        let start = self.text.len() + visible(&text[part.start..place.start]).len();
                        let end = start + visible(&text[place.clone()]).len();
                        *found = (start..end, lines.column(text, place.start));
                    }
                }
                self.text.push_str(&visible(&text[part.clone()]));
                end = part.end;
            }
            if end < whole.end {
                self.text.push_str(CUT);
            }
            self.text.push('\n');
        }
        let found = found.into_iter().zip(labels);
        self.labels
            .extend(found.map(|((place, column), (_, remark))| (place, column, *remark)));
    }

    /// The labels, as places in the excerpt.
    pub fn labels(&self) -> impl Iterator<Item = LabeledSpan> {
        self.labels
            .iter()
            .map(|(place, _, remark)| LabeledSpan::new(Some((*remark).to_string()), place.start, place.len().max(1)))
    }
}

/// A text in which a sign stands for every character that cannot be shown.
fn visible(text: &str) -> Cow<'_, str> {
    if text.chars().all(shows) {
        return text.into();
    }
    text.chars().map(|c| if shows(c) { c } else { '\u{fffd}' }).collect()
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
        let line_at = |byte: usize| self.lines.partition_point(|line| line.start <= byte) - 1;
        let (mut first, mut last) = (line_at(span.offset()), line_at(span.offset() + span.len().max(1) - 1));
        // What stands in two sources is not shown as one.
        if !std::ptr::eq(self.lines[first].source, self.lines[last].source) {
            return Err(MietteError::OutOfBounds);
        }
        // Lines that are not neighbours in the source are none here.
        for _ in 0..before {
            if first > 0 && self.lines[first - 1].is_above(&self.lines[first]) {
                first -= 1;
            }
        }
        for _ in 0..after {
            if last + 1 < self.lines.len() && self.lines[last].is_above(&self.lines[last + 1]) {
                last += 1;
            }
        }
        let (start, column) = if before == 0 {
            let label = self.labels.iter().find(|(place, ..)| place.start == span.offset());
            (span.offset(), label.map_or(0, |(_, column, _)| *column))
        } else {
            (self.lines[first].start, 0)
        };
        let end = self.lines.get(last + 1).map_or(self.text.len(), |line| line.start);
        let data = self.text.as_bytes().get(start..end).ok_or(MietteError::OutOfBounds)?;
        Ok(Box::new(MietteSpanContents::new_named(
            self.lines[first].source.to_string(),
            data,
            (start, end - start).into(),
            self.lines[first].number,
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
        let mut excerpt = Excerpt::default();
        excerpt.add(
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
        let mut excerpt = Excerpt::default();
        excerpt.add(&source, &lines, &[(span, "here")]);
        assert!(excerpt.text.len() < 200, "{}", excerpt.text);
        let label = excerpt.labels().next().unwrap();
        assert!(excerpt.text[label.offset()..].starts_with("Xü"));
        assert!(excerpt.text.starts_with("…é") && excerpt.text.ends_with("ü…\n"));
        let contents = excerpt.read_span(label.inner(), 0, 0).unwrap();
        assert_eq!((contents.line(), contents.column()), (0, 500_000));
    }
}
