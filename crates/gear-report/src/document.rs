//! A document of text, tables and pictures, written once and read as Markdown or as one HTML file.
//!
//! Texts are Markdown of one kind only: `` `code` `` and `**bold**`. Everything else in them is shown as it is.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::syntax::SyntaxConfig;
use minijinja::{Environment, Value, context};

use crate::page::PageError;
use crate::picture::Picture;

/// A document.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// The heading.
    pub title: String,
    /// One line under the heading.
    pub subtitle: String,
    /// What it consists of.
    pub blocks: Vec<Block>,
    /// The last lines: versions, how it was made.
    pub colophon: String,
}

/// A part of a document.
#[derive(Clone, Debug)]
pub enum Block {
    /// A heading; what follows belongs to it.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// Sentences with a point each.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A drawing.
    Drawing {
        /// What it shows.
        caption: String,
        /// The name of the file that holds it, for Markdown.
        file: String,
        /// The SVG element.
        svg: String,
    },
    /// A picture.
    Picture {
        /// What it shows.
        caption: String,
        /// The name of the file that holds it, for Markdown.
        file: String,
        /// The picture.
        picture: Picture,
    },
}

/// A table; the first column names the rows, the others hold numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The heads of the columns.
    pub head: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these heads and no row.
    pub fn new<S: Into<String>>(head: impl IntoIterator<Item = S>) -> Self {
        Self {
            head: head.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The table as Markdown, its columns padded so that the source reads well too.
    pub fn markdown(&self) -> String {
        let columns = self.head.len();
        let cell = |row: &[String], c: usize| row.get(c).map(|text| text.replace('|', "\\|")).unwrap_or_default();
        let width = |c: usize| {
            let rows = self.rows.iter().map(|row| cell(row, c).chars().count());
            rows.chain([cell(&self.head, c).chars().count(), 3]).max().unwrap_or(3)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let line = |row: &[String]| {
            let cells = widths.iter().enumerate().map(|(c, &width)| match c {
                0 => format!("{:<width$}", cell(row, c)),
                _ => format!("{:>width$}", cell(row, c)),
            });
            format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
        };
        let rule = widths.iter().enumerate().map(|(c, &width)| match c {
            0 => "-".repeat(width + 2),
            _ => format!("{}:", "-".repeat(width + 1)),
        });
        let mut text = line(&self.head);
        text.push_str(&format!("|{}|\n", rule.collect::<Vec<_>>().join("|")));
        text.extend(self.rows.iter().map(|row| line(row)));
        text
    }
}

impl Document {
    /// As Markdown.
    pub fn markdown(&self) -> String {
        let mut text = format!("# {}\n", self.title);
        let mut paragraph = |lines: &str| {
            if !lines.is_empty() {
                text.push('\n');
                text.push_str(lines);
                text.push('\n');
            }
        };
        paragraph(&self.subtitle);
        for block in &self.blocks {
            match block {
                Block::Heading(heading) => paragraph(&format!("## {heading}")),
                Block::Text(words) => paragraph(words),
                Block::List(items) => {
                    let items: Vec<_> = items.iter().map(|item| format!("* {item}")).collect();
                    paragraph(&items.join("\n"));
                }
                Block::Table(table) => paragraph(table.markdown().trim_end()),
                Block::Drawing { caption, file, .. } | Block::Picture { caption, file, .. } => {
                    paragraph(&format!("![{caption}]({file})"));
                }
            }
        }
        paragraph(&self.colophon);
        text
    }

    /// As one HTML file that holds everything it shows.
    pub fn html(&self) -> Result<String, PageError> {
        let mut environment = Environment::new();
        environment.set_syntax(SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build()?);
        environment.add_template("document.html", include_str!("page/document.html"))?;
        let blocks: Value = self.blocks.iter().map(block).collect();
        Ok(environment.get_template("document.html")?.render(context! {
            title => self.title.as_str(),
            subtitle => words(&self.subtitle),
            style => Value::from_safe_string(include_str!("page/style.css").to_owned()),
            blocks => blocks,
            colophon => words(&self.colophon),
        })?)
    }
}

fn block(block: &Block) -> Value {
    match block {
        Block::Heading(heading) => context! { kind => "heading", text => heading.as_str() },
        Block::Text(text) => context! { kind => "text", text => words(text) },
        Block::List(items) => {
            let items: Value = items.iter().map(|item| words(item)).collect();
            context! { kind => "list", items => items }
        }
        Block::Table(table) => {
            let row = |row: &Vec<String>| -> Value { row.iter().map(|cell| words(cell)).collect() };
            let rows: Value = table.rows.iter().map(row).collect();
            context! { kind => "table", head => row(&table.head), rows => rows }
        }
        Block::Drawing { caption, svg, .. } => context! {
            kind => "drawing", caption => words(caption), svg => Value::from_safe_string(svg.clone()),
        },
        Block::Picture { caption, picture, .. } => {
            let uri = format!(
                "data:{};base64,{}",
                picture.format.mime(),
                STANDARD.encode(&picture.bytes)
            );
            context! {
                kind => "picture", caption => words(caption), alt => caption.as_str(),
                uri => Value::from_safe_string(uri), width => picture.width, height => picture.height,
            }
        }
    }
}

/// A text as HTML: escaped, with its code and what is bold marked up.
fn words(text: &str) -> Value {
    let escaped = text
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;");
    Value::from_safe_string(marked(&marked(&escaped, "`", "code"), "**", "b"))
}

/// What stands between two `mark`s in the element `tag`; a mark without another stays.
fn marked(text: &str, mark: &str, tag: &str) -> String {
    let mut parts = text.split(mark);
    let mut html = parts.next().unwrap_or_default().to_owned();
    while let Some(inner) = parts.next() {
        match parts.next() {
            Some(after) => html.push_str(&format!("<{tag}>{inner}</{tag}>{after}")),
            None => {
                html.push_str(mark);
                html.push_str(inner);
            }
        }
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> Document {
        let mut table = Table::new(["variant", "VEND ↑"]);
        table.row(["a|b", "85.3"]);
        table.row(["**fixed**", "7"]);
        Document {
            title: "Range of α".into(),
            subtitle: "12 cases".into(),
            blocks: vec![
                Block::Heading("Table".into()),
                Block::Text("less < `more`".into()),
                Block::Table(table),
                Block::List(vec!["one".into(), "two".into()]),
            ],
            colophon: "gear".into(),
        }
    }

    #[test]
    fn markdown_can_be_read_as_it_stands() {
        let expected = "# Range of α\n\n12 cases\n\n## Table\n\nless < `more`\n\n\
                        | variant   | VEND ↑ |\n|-----------|-------:|\n| a\\|b      |   85.3 |\n| **fixed** |      7 |\n\n\
                        * one\n* two\n\ngear\n";
        assert_eq!(document().markdown(), expected);
    }

    #[test]
    fn html_holds_everything_and_escapes_what_is_text() {
        let html = document().html().unwrap();
        assert!(html.contains("less &lt; <code>more</code>"), "{html}");
        assert!(html.contains("<b>fixed</b>") && html.contains("a|b"));
        assert!(!html.contains("src=\"http") && !html.contains("href=\"http"));
    }

    #[test]
    fn a_mark_without_another_stays() {
        assert_eq!(marked("2 ** 3", "**", "b"), "2 ** 3");
        assert_eq!(marked("`a` and `b`", "`", "code"), "<code>a</code> and <code>b</code>");
    }
}
