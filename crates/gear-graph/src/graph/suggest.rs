//! Help with names: the nearest one to a misspelt one, and long ones cut to what can be read.

/// The name that `word` was most likely meant to be, if one is near: edit distance (with swaps of neighbours) of at
/// most two fifths of the longer word, ignoring case.
pub fn nearest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = word.to_lowercase();
    names
        .into_iter()
        .map(|name| (distance(&lower, &name.to_lowercase()), name))
        .filter(|(distance, name)| {
            let longer = word.chars().count().max(name.chars().count());
            longer > 1 && *distance <= (longer * 2 / 5).max(1)
        })
        .min()
        .map(|(_, name)| name)
}

/// Optimal string alignment distance.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    // Names of a graph are short; what is absurdly long is near nothing.
    if a.len().max(b.len()) > 256 {
        return usize::MAX;
    }
    let mut before: Vec<usize> = Vec::new();
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let swap = usize::from(a[i - 1] != b[j - 1]);
            row[j] = (above[j - 1] + swap).min(above[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

/// `name:value`, which YAML takes for one word, as it was meant.
pub(crate) fn glued(key: &str) -> Option<String> {
    let (name, value) = key.split_once(':')?;
    let is_name = name.starts_with(char::is_alphabetic)
        && name
            .chars()
            .all(|c| c.is_alphanumeric() || c == '_' || c == '-' || c == '.');
    (is_name && !value.is_empty()).then(|| format!("a colon is followed by a space: `{name}: {value}`"))
}

/// A type's name with the article before it.
pub(crate) fn with_article(name: &str) -> String {
    let article = if name.starts_with(['A', 'E', 'I', 'O', 'U']) {
        "an"
    } else {
        "a"
    };
    format!("{article} {name}")
}

/// The longest quoted text, and the longest message, in characters.
const QUOTE: usize = 60;
const MESSAGE: usize = 800;

/// Whether a character is shown in its own right. Others could move the cursor, or turn the line around.
pub(crate) fn shows(c: char) -> bool {
    c == '\t'
        || !(c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'))
}

/// Cuts what a message quotes (between backticks) to 60 characters, and the whole of it to a few lines. What cannot be
/// shown is written as its number.
pub(crate) fn clip(message: &mut String) {
    if message.contains(|c: char| !shows(c)) {
        let chars = message.chars();
        *message = chars
            .map(|c| {
                if shows(c) {
                    c.to_string()
                } else {
                    c.escape_unicode().to_string()
                }
            })
            .collect();
    }
    if message.len() <= QUOTE {
        return;
    }
    let shorter = |text: &str, most: usize| match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    };
    let parts: Vec<_> = message
        .split('`')
        .enumerate()
        .map(|(i, part)| {
            if i % 2 == 1 {
                shorter(part, QUOTE)
            } else {
                part.to_string()
            }
        })
        .collect();
    *message = shorter(&parts.join("`"), MESSAGE);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_move_the_cursor_is_written_as_its_number() {
        let mut message = "`a\u{1b}[31mb\u{202e}c`".to_string();
        clip(&mut message);
        assert_eq!(message, r"`a\u{1b}[31mb\u{202e}c`");
    }

    #[test]
    fn types_have_their_article() {
        assert_eq!(with_article("Image"), "an Image");
        assert_eq!(with_article("Mask"), "a Mask");
    }

    #[test]
    fn what_is_quoted_is_cut_and_what_is_said_is_not() {
        let said = "a sentence of more than sixty characters that quotes nothing stays as it is, quoting `little` too";
        let mut message = said.to_string();
        clip(&mut message);
        assert_eq!(message, said);
        let mut message = format!("found the text `{}`, expected `a`", "é".repeat(1_000_000));
        clip(&mut message);
        assert_eq!(message, format!("found the text `{}…`, expected `a`", "é".repeat(60)));
        let mut message = "`".repeat(1_000_000);
        clip(&mut message);
        assert!(message.len() < 1000);
    }

    #[test]
    fn a_slip_finds_its_name_and_a_stranger_finds_none() {
        let names = ["LogRatio", "Pyramid", "Recompose"];
        assert_eq!(nearest("logratio", names), Some("LogRatio"));
        assert_eq!(nearest("Pyarmid", names), Some("Pyramid"));
        assert_eq!(nearest("Recompse", names), Some("Recompose"));
        assert_eq!(nearest("Blur", names), None);
        assert_eq!(nearest("", names), None);
        assert_eq!(nearest("q", ["a", "b"]), None);
        assert_eq!(nearest("Adder", ["Add"]), Some("Add"));
    }
}
