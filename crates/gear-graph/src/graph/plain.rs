//! A reader for the plain part of YAML that large graphs are written in: ten times as fast as the whole of it, with a
//! tenth of the memory.
//!
//! # How it works
//!
//! Graph files that programs write are maps of words and numbers, a node a line:
//!
//! ```yaml
//! nodes:
//!   n1: {node: Add, in: {of: [x, n0.sum]}, with: {plus: 1.5}}
//! ```
//!
//! This reader knows block maps, flow maps and lists within one line, lines that are comments, words and decimal
//! numbers, and gives up at the first byte that is anything else: quotes, anchors, tags, tabs, `null`, other alphabets,
//! comments behind a value, flow that goes over lines. Whoever calls it then reads the whole text with `serde_saphyr`.
//! So it never reports a mistake, and knows nothing of the rest of YAML.
//!
//! # What must stay true
//!
//! * When it gives a tree, it is the tree that `serde_saphyr` gives, places included. When in doubt it gives up. A test
//!   compares both on texts made of pieces that are in doubt.
//! * It reads every byte once, and recurses no deeper than [`DEEPEST`].

use crate::{Span, Spanned, Tree, TreeKind};

/// Below the limit of the whole reader.
const DEEPEST: u32 = 32;
/// Keys and values; below the budget of the whole reader.
const MOST: u32 = 3_000_000;

/// The tree of a plain text; `None` if there is anything in it that is not known here.
pub fn parse(text: &str, source: u32) -> Option<Tree> {
    let known = |byte: &u8| matches!(byte, b' '..=b'~' | b'\n');
    if text.len() > u32::MAX as usize || !text.bytes().all(|byte| known(&byte)) {
        return None;
    }
    let mut reader = Reader {
        text,
        bytes: text.as_bytes(),
        at: 0,
        source,
        count: 0,
    };
    let indent = reader.next_line()?;
    let tree = (indent == 0).then(|| reader.block_map(0, 0))??;
    (reader.at == reader.bytes.len()).then_some(tree)
}

struct Reader<'t> {
    text: &'t str,
    bytes: &'t [u8],
    at: usize,
    source: u32,
    count: u32,
}

impl Reader<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn eat(&mut self, byte: u8) -> Option<()> {
        (self.peek()? == byte).then(|| self.at += 1)
    }

    fn spaces(&mut self) {
        while self.peek() == Some(b' ') {
            self.at += 1;
        }
    }

    fn span(&self, start: usize, len: usize) -> Span {
        Span {
            source: self.source,
            start: start as u32,
            len: len as u32,
        }
    }

    /// Goes to the first byte of the next line that says something; how far it is indented. `None` at the end.
    fn next_line(&mut self) -> Option<usize> {
        loop {
            let start = self.at;
            self.spaces();
            match self.peek()? {
                b'\n' => self.at += 1,
                b'#' => match self.bytes[self.at..].iter().position(|byte| *byte == b'\n') {
                    Some(end) => self.at += end + 1,
                    None => {
                        self.at = self.bytes.len();
                        return None;
                    }
                },
                _ => return Some(self.at - start),
            }
        }
    }

    /// The rest of a line that must hold nothing more.
    fn end_of_line(&mut self) -> Option<()> {
        self.spaces();
        match self.peek() {
            None => Some(()),
            Some(_) => self.eat(b'\n'),
        }
    }

    /// A map whose first key is the next byte, `indent` bytes into its line.
    fn block_map(&mut self, indent: usize, depth: u32) -> Option<Tree> {
        let span = self.span(self.at, 0);
        let mut entries = Vec::new();
        loop {
            let key = self.key()?;
            let value = if matches!(self.peek(), None | Some(b'\n')) || self.only_spaces_left() {
                self.end_of_line()?;
                let inner = self.next_line()?;
                (inner > indent && depth < DEEPEST).then(|| self.block_map(inner, depth + 1))??
            } else {
                self.eat(b' ')?;
                self.spaces();
                let value = self.value(depth + 1)?;
                self.end_of_line()?;
                value
            };
            entries.push((key, value));
            // A block map ends in front of the next line that says something, whose indentation is looked at again.
            match self.next_line() {
                Some(next) if next == indent => {}
                Some(next) if next < indent => {
                    self.at = self.start_of_line();
                    break;
                }
                Some(_) => return None,
                None => break,
            }
        }
        Some(Tree {
            span,
            kind: TreeKind::Map(entries),
        })
    }

    fn only_spaces_left(&self) -> bool {
        let rest = self.bytes[self.at..].iter().find(|byte| **byte != b' ');
        matches!(rest, None | Some(b'\n'))
    }

    fn start_of_line(&self) -> usize {
        let before = self.bytes[..self.at].iter().rposition(|byte| *byte == b'\n');
        before.map_or(0, |end| end + 1)
    }

    /// A word and the colon behind it.
    fn key(&mut self) -> Option<Spanned<String>> {
        let start = self.at;
        let word = self.token()?;
        let good = word.len() <= 128
            && word.starts_with(|c: char| c.is_ascii_alphabetic())
            && !in_doubt(word)
            && word
                .bytes()
                .all(|c| c.is_ascii_alphanumeric() || c == b'_' || c == b'-');
        let key = Spanned {
            value: good.then(|| word.to_string())?,
            span: self.span(start, self.at - start),
        };
        self.eat(b':')?;
        self.counted()?;
        Some(key)
    }

    fn counted(&mut self) -> Option<()> {
        self.count += 1;
        (self.count < MOST).then_some(())
    }

    /// The bytes of a word or number; what stands behind it must be looked at by the caller.
    fn token(&mut self) -> Option<&str> {
        let start = self.at;
        let end = self.bytes[start..]
            .iter()
            .position(|c| !(c.is_ascii_alphanumeric() || matches!(c, b'_' | b'.' | b'-' | b'/')))
            .map_or(self.bytes.len(), |len| start + len);
        self.at = end;
        self.text.get(start..end).filter(|token| !token.is_empty())
    }

    fn value(&mut self, depth: u32) -> Option<Tree> {
        self.counted()?;
        match self.peek()? {
            b'{' | b'[' if depth > DEEPEST => None,
            b'{' => self.flow_map(depth),
            b'[' => self.flow_list(depth),
            _ => {
                let start = self.at;
                let kind = scalar(self.token()?)?;
                Some(Tree {
                    span: self.span(start, self.at - start),
                    kind,
                })
            }
        }
    }

    fn flow_map(&mut self, depth: u32) -> Option<Tree> {
        let span = self.span(self.at, 1);
        let mut entries = Vec::new();
        self.flow(b'{', b'}', |reader| {
            let key = reader.key()?;
            reader.eat(b' ')?;
            reader.spaces();
            entries.push((key, reader.value(depth + 1)?));
            Some(())
        })?;
        Some(Tree {
            span,
            kind: TreeKind::Map(entries),
        })
    }

    fn flow_list(&mut self, depth: u32) -> Option<Tree> {
        let span = self.span(self.at, 1);
        let mut items = Vec::new();
        self.flow(b'[', b']', |reader| {
            items.push(reader.value(depth + 1)?);
            Some(())
        })?;
        Some(Tree {
            span,
            kind: TreeKind::List(items),
        })
    }

    /// What stands between two brackets, separated by commas.
    fn flow(&mut self, open: u8, close: u8, mut entry: impl FnMut(&mut Self) -> Option<()>) -> Option<()> {
        self.eat(open)?;
        self.spaces();
        if self.eat(close).is_some() {
            return Some(());
        }
        loop {
            entry(self)?;
            self.spaces();
            if self.eat(close).is_some() {
                return Some(());
            }
            self.eat(b',')?;
            self.spaces();
        }
    }
}

/// Words that are something else in some spelling. `yes` and the like are words: the whole reader is strict too.
fn in_doubt(word: &str) -> bool {
    const WORDS: [&str; 6] = ["null", "true", "false", "nan", "inf", "infinity"];
    word.len() <= 8 && WORDS.iter().any(|other| word.eq_ignore_ascii_case(other))
}

/// A word, `true`, `false`, or a decimal number without an exponent.
fn scalar(token: &str) -> Option<TreeKind> {
    if token.starts_with(|c: char| c.is_ascii_alphabetic()) {
        return match token {
            "true" => Some(TreeKind::Bool(true)),
            "false" => Some(TreeKind::Bool(false)),
            _ if in_doubt(token) => None,
            _ => Some(TreeKind::Text(token.to_string())),
        };
    }
    let digits = token.strip_prefix('-').unwrap_or(token);
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, "0"));
    let number = |part: &str| !part.is_empty() && part.len() <= 15 && part.bytes().all(|c| c.is_ascii_digit());
    if !number(whole) || !number(fraction) || (whole.len() > 1 && whole.starts_with('0')) {
        return None;
    }
    if digits.contains('.') {
        token.parse().ok().map(TreeKind::Float)
    } else {
        token.parse().ok().map(TreeKind::Integer)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::graph::yaml::parse_any;

    const GRAPH: &str = "# a graph
gear: 1

inputs:
  painting: {type: Image, with: {size: 768}}
  mask:   {type: Mask, optional: true}
nodes:
  # how it begins
  n-1:  {node: Add,   in: {of: [x, n0.sum,  n-2.sum ]}, with: {plus: 1.50, k: -3, e: {}, l: [ ]} }
  n2:
    node: Add
    in:
        of: n1.sum

    with: {plus: 2, a: {b: {c: [1, [2, {d: 0.25}]]}}}
outputs: {y: n1.sum}
";

    fn whole(text: &str) -> Option<Tree> {
        parse_any(text, 3, &mut Vec::new())
    }

    #[test]
    fn plain_graphs_are_read_with_their_places() {
        let tree = parse(GRAPH, 3).expect("nothing in it is odd");
        assert_eq!(Some(tree), whole(GRAPH));
    }

    #[test]
    fn what_is_not_plain_is_left_to_the_whole_reader() {
        for text in [
            "a: 'x'",
            "a: null",
            "a: ~",
            "a:",
            "a: True",
            "a: 012",
            "a: 1e5",
            "a: .5",
            "a: 1.",
            "a: +1",
            "a: 0x1F",
            "a: 2001-01-01",
            "a: b c",
            "a: b # c",
            "a: &b c",
            "a: *b",
            "a: |\n  b",
            "a:\tb",
            "a: [1,\n 2]",
            "a: {b: 1,}",
            "- a",
            "--- \na: 1",
            "a: 1\n b: 2",
            "  a: 1\nb: 2",
            "é: 1",
            "a: {b:1}",
            "a:1",
            "1: a",
            "",
            "# nothing",
            "a: 1\n...",
            "a: b: c",
            "? a",
            "a: 12345678901234567890",
            "a: !!str b",
        ] {
            assert_eq!(parse(text, 0), None, "{text:?}");
        }
    }

    #[test]
    fn depth_is_left_to_the_whole_reader() {
        let deep = format!("a: {}1{}", "[".repeat(10_000), "]".repeat(10_000));
        assert_eq!(parse(&deep, 0), None);
        let block: String = (0..10_000).map(|i| format!("{}a:\n", " ".repeat(i))).collect();
        assert_eq!(parse(&block, 0), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn whatever_it_reads_is_what_the_whole_reader_reads(
            pieces in prop::collection::vec(prop::sample::select(vec![
                "a", "node", "n1.sum", "-", "1", "-2", "0.5", "0", "-0", "-0.0", "00", "1.", "true", "No",
                "y",
                "off", "null", "x/y", "e5", "1e5",
                ": ", ":", ",", ", ", "{", "}", "[", "]", " ", "  ", "\n", "\n  ", "\n    ", "\n ", "#", " # c", "\n# c\n",
                "_", ".", "9007199254740993", "123456789012345.123456789012345", "b: 1", "c: {d: [1, e]}", "f:\n  g: h\n",
            ]), 0..14),
            start in prop::sample::select(vec!["", "a: ", "a: {", "a: [", "a:\n  b: ", "a:\n  b: 1\n"]),
        ) {
            let text = format!("{start}{}", pieces.concat());
            if let Some(tree) = parse(&text, 3) {
                prop_assert_eq!(Some(tree), whole(&text), "{:?}", text);
            }
        }

        #[test]
        fn a_graph_with_some_bytes_changed(at in 0usize..2000, with in "[ -~\n]{0,3}", cut in 0usize..4) {
            let at = at % GRAPH.len();
            let end = (at + cut).min(GRAPH.len());
            let text = format!("{}{with}{}", &GRAPH[..at], &GRAPH[end..]);
            if let Some(tree) = parse(&text, 3) {
                prop_assert_eq!(Some(tree), whole(&text), "{:?}", text);
            }
        }
    }
}
