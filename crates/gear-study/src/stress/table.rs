//! Rows for people and for programs, and the catalogue as a page of the book.

use std::fmt::Write;

use super::{Case, Catalogue, Holds, Outcome, Row};
use crate::planes::Extent;

impl Outcome {
    /// One word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Answers => "answers",
            Self::Refuses => "refuses",
            Self::Breaks => "BREAKS",
            Self::Hangs => "HANGS",
            Self::Idle => "idle",
        }
    }
}

/// A row in one line of columns.
pub fn text(row: &Row) -> String {
    let mut line = format!("{:<16} {:<50} {:<8}", row.node, row.case, row.outcome.word());
    match &row.extent {
        Some(extent) => {
            let _ = write!(line, " {:<34}", of_extent(extent));
        }
        None => {
            let _ = write!(line, " {:<34}", "");
        }
    }
    let error = row.error.map(|error| format!("f64 {error:.1e}")).unwrap_or_default();
    let _ = write!(line, " {error:<11} {:>8}", seconds(row.seconds));
    if let Some(surprise) = &row.surprise {
        let _ = write!(line, "  SURPRISE: {surprise}");
    } else if !row.message.is_empty() {
        let first = row.message.lines().next().unwrap_or_default();
        let short: String = first.chars().take(90).collect();
        let _ = write!(line, "  {short}");
    }
    line.trim_end().to_owned()
}

/// `-1.2e0..3.4e5, 12 NaN`.
fn of_extent(extent: &Extent) -> String {
    let range = format!("{}..{}", number(extent.low), number(extent.high));
    match extent.not_finite {
        0 => format!("finite {range}"),
        bad => format!("{bad} NaN or inf, {range}"),
    }
}

fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e4).contains(&x.abs()) {
        let text = format!("{x:.4}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{x:.2e}")
    }
}

fn seconds(seconds: f64) -> String {
    if seconds < 1.0 {
        format!("{:.1} ms", seconds * 1e3)
    } else {
        format!("{seconds:.2} s")
    }
}

/// All rows, for programs.
pub fn json(rows: &[Row]) -> serde_json::Value {
    let surprises = rows.iter().filter(|row| row.surprise.is_some()).count();
    serde_json::json!({"format": 1, "surprises": surprises, "rows": rows})
}

/// The catalogue as tables in Markdown: the values, what nodes refuse, the cases.
pub fn catalogue_markdown(catalogue: &Catalogue) -> String {
    let mut out = String::from("| value | what is extreme |\n|---|---|\n");
    for named in &catalogue.values {
        let _ = writeln!(out, "| `{}` | {} |", named.name, named.why);
    }
    out.push_str("\n| node | refuses |\n|---|---|\n");
    for (node, entry) in &catalogue.nodes {
        let refused: Vec<_> = entry
            .refuses
            .iter()
            .map(|(port, names)| {
                let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
                format!("at `{port}`: {}", names.join(", "))
            })
            .collect();
        let refused = if refused.is_empty() {
            "nothing".to_owned()
        } else {
            refused.join("; ")
        };
        let _ = writeln!(out, "| `{node}` | {refused} |");
    }
    out.push_str("\n| output | at most from its f64 reference | and at |\n|---|---|---|\n");
    for (node, entry) in &catalogue.nodes {
        for (output, most) in &entry.reference {
            let looser = entry.looser.iter().map(|(value, most)| format!("`{value}` {most:e}"));
            let looser: Vec<_> = looser.collect();
            let _ = writeln!(out, "| `{node}.{output}` | {most:e} | {} |", looser.join(", "));
        }
    }
    out.push_str("\n| case | node | expected |\n|---|---|---|\n");
    for case in &catalogue.cases {
        let _ = writeln!(out, "| {} | `{}` | {} |", case.name, case.node, expected(case));
    }
    out
}

fn expected(case: &Case) -> String {
    if let Some(words) = &case.expect.refused {
        return format!("refused: “{words}”");
    }
    let outputs: Vec<_> = case
        .expect
        .outputs
        .iter()
        .map(|(port, holds)| held(port, holds))
        .collect();
    if outputs.is_empty() {
        "an answer without flaw".to_owned()
    } else {
        outputs.join("; ")
    }
}

fn held(port: &str, holds: &Holds) -> String {
    let mut parts = Vec::new();
    if let Some([low, high]) = holds.range {
        parts.push(if low == high {
            format!("`{port}` is {}", number(low))
        } else {
            format!("`{port}` in {}..{}", number(low), number(high))
        });
    }
    if let Some(input) = &holds.same_as {
        parts.push(format!("`{port}` is `{input}`"));
    }
    let within = if holds.within > 0.0 {
        format!(" within {:e}", holds.within)
    } else {
        String::new()
    };
    parts.join(", ") + &within
}
