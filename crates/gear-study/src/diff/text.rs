//! The comparison of two runs for people.

use std::fmt::Write;

use super::compare::{Comparison, Fate};

/// So many numbers of reports are told in all, and so many of each report at least.
const MOST_NUMBERS: usize = 20;
const FEW_NUMBERS: usize = 2;

/// Several lines; what is the same is only counted. Of the numbers in reports the largest differences are told, or `all`.
pub fn text(comparison: &Comparison, all: bool) -> String {
    let mut text = String::new();
    let mut section = |title: &str, lines: Vec<String>| {
        if !lines.is_empty() {
            let _ = writeln!(text, "{}{title}", if text.is_empty() { "" } else { "\n" });
            for line in lines {
                let _ = writeln!(text, "  {line}");
            }
        }
    };
    let or_nothing = |value: &str| {
        if value.is_empty() {
            "nothing".to_owned()
        } else {
            value.to_owned()
        }
    };
    let facts = comparison.facts.iter();
    section(
        "the runs",
        facts
            .map(|f| format!("{}: {} → {}", f.what, or_nothing(&f.a), or_nothing(&f.b)))
            .collect(),
    );
    let nodes = &comparison.nodes;
    let changed = nodes.iter().flat_map(|node| {
        let changes = node.changed.iter();
        changes.map(move |c| format!("{}.{}: {} → {}", node.id, c.what, or_nothing(&c.a), or_nothing(&c.b)))
    });
    section("what was changed", changed.collect());

    let width = nodes.iter().map(|node| node.id.chars().count()).max().unwrap_or(0);
    let same = nodes.iter().filter(|node| node.fate == Fate::Same).count();
    let mut results: Vec<String> = nodes
        .iter()
        .filter(|node| !matches!(node.fate, Fate::Same | Fate::Neither))
        .map(|node| {
            let of = match (node.fate, node.status.0.as_str(), node.status.1.as_str()) {
                (Fate::OneRun, a, b) => format!(" ({} → {})", status(a), status(b)),
                _ => String::new(),
            };
            format!("{:<width$}  {}{of}", node.id, node.fate.words())
        })
        .collect();
    if same > 0 {
        results.push(match same {
            1 => "1 node or input has the same keys and results".to_owned(),
            same => format!("{same} nodes and inputs have the same keys and results"),
        });
    }
    section("results", results);

    let mut outputs = Vec::new();
    let reports = comparison.outputs.iter().filter(|output| !output.numbers.is_empty());
    let each = match (all, reports.count()) {
        (true, _) => usize::MAX,
        (false, reports) => (MOST_NUMBERS / reports.max(1)).max(FEW_NUMBERS),
    };
    let mut more = 0;
    for output in comparison.outputs.iter().filter(|output| !output.same) {
        let norms: Vec<_> = output
            .norms
            .iter()
            .map(|(name, value)| format!("{name} {}", short(*value)))
            .collect();
        let said = [norms.join(", "), output.remark.clone()];
        let said: Vec<_> = said.into_iter().filter(|part| !part.is_empty()).collect();
        outputs.push(format!(
            "{} ({}): {}",
            output.name,
            output.type_name,
            match said.is_empty() {
                true => "it differs".to_owned(),
                false => said.join("; "),
            }
        ));
        more += output.numbers.len().saturating_sub(each);
        for (place, a, b) in output.numbers.iter().take(each) {
            let told = |n: &Option<f64>| n.map_or("nothing".to_owned(), short);
            let (told_a, told_b) = match (a, b) {
                (Some(a), Some(b)) => told_apart(*a, *b),
                _ => (told(a), told(b)),
            };
            let by = match (a, b) {
                (Some(a), Some(b)) => format!("  ({}{})", if b >= a { "+" } else { "−" }, short((b - a).abs())),
                _ => String::new(),
            };
            outputs.push(format!("  {place}: {told_a} → {told_b}{by}"));
        }
    }
    if more > 0 {
        outputs.push(format!("… and {more} more numbers differ, by less; --all shows them"));
    }
    let same = comparison.outputs.iter().filter(|output| output.same).count();
    if same > 0 {
        outputs.push(format!(
            "{same} of {} outputs {} the same to the last bit",
            comparison.outputs.len(),
            if same == 1 { "is" } else { "are" }
        ));
    }
    section("outputs", outputs);

    let timed = nodes.iter().filter_map(|node| match node.seconds {
        (Some(a), Some(b)) if a.max(b) >= 0.01 => Some(format!(
            "{:<width$}  {:>8} s → {:>8} s{}",
            node.id,
            format!("{a:.2}"),
            format!("{b:.2}"),
            match (node.status.0.as_str(), node.status.1.as_str()) {
                ("cached", "cached") => "  (both when they were stored)",
                ("cached", _) => "  (the first when it was stored)",
                (_, "cached") => "  (the second when it was stored)",
                _ => "",
            }
        )),
        _ => None,
    });
    section("seconds of nodes", timed.collect());
    text
}

/// What became of a node, as other commands say it.
fn status(of_record: &str) -> String {
    match of_record {
        "" => "nothing".to_owned(),
        "cached" => "stored".to_owned(),
        other => other.replace('-', " "),
    }
}

/// Two numbers as [`short`] tells them, or with as many digits as tell them apart.
fn told_apart(a: f64, b: f64) -> (String, String) {
    let digits = |n: usize| {
        let rounded = |x: f64| format!("{x:.*e}", n - 1).parse::<f64>().unwrap_or(x).to_string();
        (rounded(a), rounded(b))
    };
    let brief = (short(a), short(b));
    let mut longer = (5..=17).map(digits);
    match brief.0 == brief.1 && a != b {
        true => longer.find(|(a, b)| a != b).unwrap_or(brief),
        false => brief,
    }
}

/// Whole numbers as they are, others with four significant digits.
fn short(value: f64) -> String {
    let size = value.abs();
    if value.fract() == 0.0 && size < 1e15 {
        format!("{value:.0}")
    } else if (0.001..1e15).contains(&size) {
        let mut digits = 0;
        while digits < 6 && size * f64::from(10u32.pow(digits)) < 1000.0 {
            digits += 1;
        }
        let text = format!("{value:.*}", digits as usize);
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_numbers_that_differ_look_different() {
        assert_eq!(
            told_apart(0.445_61, 0.445_62),
            ("0.44561".to_owned(), "0.44562".to_owned())
        );
        assert_eq!(
            told_apart(-5.795_01, -5.794_93),
            ("-5.795".to_owned(), "-5.7949".to_owned())
        );
        assert_eq!(told_apart(22242.0, 22239.0), ("22242".to_owned(), "22239".to_owned()));
        assert_eq!(told_apart(1.0, 1.0), ("1".to_owned(), "1".to_owned()));
    }
}
