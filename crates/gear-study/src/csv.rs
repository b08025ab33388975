//! CSV (RFC 4180): commas between cells, quotes around what holds commas, quotes or ends of lines.

use gear_graph::{Span, Spanned};

/// The cells of all lines that are not empty, without spaces around them; each with its place in the text, which is
/// `source` among others.
pub fn rows(text: &str, source: u32) -> Vec<Vec<Spanned<String>>> {
    let mut rows = Vec::new();
    let mut row: Vec<Spanned<String>> = Vec::new();
    let mut cell = String::new();
    let (mut start, mut quoted) = (0, false);
    let mut chars = text.char_indices().peekable();
    let close = |row: &mut Vec<Spanned<String>>, cell: &mut String, start: usize, end: usize| {
        let span = Span {
            source,
            start: start as u32,
            len: (end - start) as u32,
        };
        let value = std::mem::take(cell).trim().to_owned();
        row.push(Spanned { value, span });
    };
    while let Some((at, c)) = chars.next() {
        match c {
            '\u{feff}' if at == 0 => start = c.len_utf8(),
            '"' if quoted && chars.peek().is_some_and(|(_, next)| *next == '"') => {
                chars.next();
                cell.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => {
                close(&mut row, &mut cell, start, at);
                start = at + 1;
            }
            '\n' if !quoted => {
                close(&mut row, &mut cell, start, at);
                rows.push(std::mem::take(&mut row));
                start = at + 1;
            }
            '\r' if !quoted => {}
            _ => cell.push(c),
        }
    }
    if !cell.is_empty() || !row.is_empty() {
        close(&mut row, &mut cell, start, text.len());
        rows.push(row);
    }
    rows.retain(|row| row.len() > 1 || row.iter().any(|cell| !cell.value.is_empty()));
    rows
}

/// A line, with its end; cells that need quotes get them.
pub fn line(cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<String> = cells
        .map(|cell| match cell.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell,
        })
        .collect();
    format!("{}\n", cells.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let row = ["plain", "a, b", "say \"no\"", "two\nlines", ""].map(str::to_owned);
        let text = format!("{}\r\n{}", line(row.clone().into_iter()), line(row.clone().into_iter()));
        let read = rows(&text, 0);
        assert_eq!(read.len(), 2, "an empty line is no row");
        for cells in read {
            assert!(cells.iter().map(|cell| &cell.value).eq(&row), "{cells:?}");
        }
    }

    #[test]
    fn a_cell_knows_its_place() {
        let text = "\u{feff}a, b\nc,\"d\"\n";
        let read = rows(text, 3);
        let last = &read[1][1];
        let (start, end) = (last.span.start as usize, (last.span.start + last.span.len) as usize);
        assert_eq!(
            (last.value.as_str(), &text[start..end], last.span.source),
            ("d", "\"d\"", 3)
        );
        assert_eq!(read[0][0].value, "a");
    }
}
