//! The tables of a study, for reading, and everything it writes.

use gear_report::document::{Block, Document, Table};
use gear_report::picture::{Picture, Pixels};
use gear_report::sheet::contact_sheet;

use super::file::{Better, Measure, Study};
use super::paper::{Verdict, compare};
use super::results::{Results, Row};
use crate::stats::{Interval, Spread};

/// Side of a cell of a contact sheet, in pixels.
const CELL: usize = 150;
/// Most cases of a contact sheet, and most views of a case: a JPEG has at most 65,535 rows, and nobody looks at as many.
const MOST_ROWS: usize = 64;
const MOST_VIEWS: usize = 9;

/// The sentence that stands beside published numbers.
pub const NOT_COMPARABLE: &str = "**The published numbers are not comparable with ours in absolute terms**: they were \
measured with other networks, on other pictures, at another size, by other implementations of the measures. What can be \
compared is the order of the rows; that is done below, pair by pair.";

/// A file that a study writes: its name below the output folder, with `/`, and its bytes.
#[derive(Clone, Debug)]
pub struct File {
    /// The name.
    pub name: String,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Everything a study writes when it is done, or why it could not be made.
pub fn files(study: &Study, results: &Results, colophon: &str) -> Result<Vec<File>, String> {
    let sheets = sheets(study, results);
    let document = document(study, results, &sheets, colophon);
    let text = |name: &str, text: String| File {
        name: name.to_owned(),
        bytes: text.into_bytes(),
    };
    let mut files = vec![
        text("rows.csv", results.rows_csv(study)),
        text("summary.csv", results.summary_csv(study)),
        text("study.md", document.markdown()),
        text("study.html", document.html().map_err(|e| e.to_string())?),
        text("study.json", format!("{:#}\n", json(study, results))),
    ];
    for (variant, sheet) in &sheets {
        files.push(File {
            name: sheet_file(study, *variant),
            bytes: sheet.bytes.clone(),
        });
    }
    Ok(files)
}

fn sheet_file(study: &Study, variant: usize) -> String {
    format!("sheets/{}.jpg", study.variants[variant].name)
}

/// The painting and the views of a row: as files, with their names in the row, and small for the contact sheet.
pub(super) fn pictures(
    study: &Study,
    row: &mut Row,
    painting: Option<&Pixels>,
    views: Vec<(String, Pixels)>,
) -> Vec<File> {
    let (case, variant) = (&study.cases[row.case].name, &study.variants[row.variant].name);
    let mut files = Vec::new();
    let mut file = |name: String, pixels: &Pixels| {
        let bytes = pixels.jpeg().ok()?.bytes;
        files.push(File {
            name: name.clone(),
            bytes,
        });
        Some(name)
    };
    if row.case < MOST_ROWS && !views.is_empty() {
        let some = views.len().min(MOST_VIEWS);
        let chosen = (0..some).map(|i| &views[i * views.len() / some].1);
        let cells = painting.into_iter().chain(chosen);
        row.small = cells.map(|pixels| Some(pixels.clone().at_most(CELL))).collect();
    }
    row.painting = painting.and_then(|pixels| file(format!("paintings/{case}.jpg"), pixels));
    for (name, pixels) in views {
        let path = format!("views/{case}/{variant}/{}.jpg", super::cases::plain(&name));
        row.views.extend(file(path, &pixels).map(|path| (name, path)));
    }
    files
}

/// What other programs read (`gear ballot` among them): cases, variants, rows with numbers and the names of pictures.
fn json(study: &Study, results: &Results) -> serde_json::Value {
    use serde_json::json;
    let rows: Vec<_> = results
        .rows
        .iter()
        .map(|row| {
            let names = study.measures.iter().map(|measure| measure.name.clone());
            let measures: serde_json::Map<_, _> = names.zip(row.values.iter().map(|value| json!(value))).collect();
            let views = row.views.iter().map(|(name, file)| json!({"name": name, "file": file}));
            let views: Vec<_> = views.collect();
            json!({
                "case": study.cases[row.case].name, "variant": study.variants[row.variant].name, "failure": row.failure,
                "measures": measures, "seconds": row.seconds, "ran": row.ran, "stored": row.stored, "views": views,
            })
        })
        .collect();
    let cases: Vec<_> = study
        .cases
        .iter()
        .enumerate()
        .map(|(c, case)| {
            let fields: serde_json::Map<_, _> = case.fields.iter().map(|(f, v)| (f.clone(), json!(v))).collect();
            let painting = results.rows.iter().find(|row| row.case == c && row.painting.is_some());
            json!({"name": case.name, "picture": case.picture.to_string(), "fields": fields,
                "painting": painting.and_then(|row| row.painting.clone())})
        })
        .collect();
    let variants: Vec<_> = study
        .variants
        .iter()
        .map(|v| json!({"name": v.name, "label": v.label}))
        .collect();
    let executions = results.executions();
    json!({
        "format": 1, "study": study.name, "title": study.title, "cases": cases, "variants": variants, "rows": rows,
        "executions": {"ran": executions.ran, "needed": executions.needed, "repeated": results.repeated},
    })
}

/// A contact sheet a variant: a row a case, the painting and then a column a view.
fn sheets(study: &Study, results: &Results) -> Vec<(usize, Picture)> {
    let of = |variant: usize| -> Option<(usize, Picture)> {
        let rows: Vec<Vec<Option<Pixels>>> = results
            .rows
            .iter()
            .filter(|row| row.variant == variant && row.case < MOST_ROWS)
            .map(|row| row.small.clone())
            .collect();
        contact_sheet(rows, CELL).ok().map(|sheet| (variant, sheet))
    };
    (0..study.variants.len()).filter_map(of).collect()
}

/// The tables.
pub fn document(study: &Study, results: &Results, sheets: &[(usize, Picture)], colophon: &str) -> Document {
    let mut blocks = Vec::new();
    if !study.about.is_empty() {
        blocks.push(Block::Text(study.about.trim().to_owned()));
    }
    if study.paper.is_some() {
        blocks.push(Block::Text(NOT_COMPARABLE.to_owned()));
    }
    blocks.push(Block::Table(main_table(study, results)));
    blocks.push(Block::Text(format!(
        "Mean ± standard deviation over {} cases{}; the best of each column is bold.{}",
        study.cases.len(),
        match all_have_values(study, results) {
            true => "",
            false => ", or over the n of them that have a value where a cell says so",
        },
        match &study.paper {
            Some(paper) => format!(" Columns *published*: {}.", paper.source).replace('*', ""),
            None => String::new(),
        }
    )));
    differences(study, results, &mut blocks);
    agreement(study, results, &mut blocks);
    for group in &study.groups {
        blocks.push(Block::Heading(format!("By {group}")));
        blocks.push(Block::Table(group_table(study, results, group)));
    }
    failures(study, results, &mut blocks);
    blocks.push(Block::Heading("What was computed".to_owned()));
    blocks.push(Block::Text(computed(study, results)));
    if !sheets.is_empty() {
        blocks.push(Block::Heading("Contact sheets".to_owned()));
        let names = study.cases.iter().take(MOST_ROWS).map(|case| case.name.as_str());
        let names: Vec<_> = names.collect();
        blocks.push(Block::Text(format!(
            "A row a case, the painting first; from above: {}.{}",
            names.join(", "),
            match study.cases.len().saturating_sub(MOST_ROWS) {
                0 => String::new(),
                more => format!(" The views of {more} more are in `views/` alone."),
            }
        )));
        for (variant, picture) in sheets {
            blocks.push(Block::Picture {
                caption: study.variants[*variant].label.clone(),
                file: sheet_file(study, *variant),
                picture: picture.clone(),
            });
        }
    }
    Document {
        title: study.title.clone(),
        subtitle: format!("{} cases, {} variants", study.cases.len(), study.variants.len()),
        blocks,
        colophon: colophon.to_owned(),
    }
}

/// What ran against what was needed, in a sentence.
pub fn computed(study: &Study, results: &Results) -> String {
    let executions = results.executions();
    format!(
        "{} cases × {} variants needed the results of {} nodes; {} nodes ran, {}.",
        study.cases.len(),
        study.variants.len(),
        executions.needed,
        executions.ran,
        match results.repeated {
            0 => "no output twice for the same case and parameters".to_owned(),
            n => format!("{n} outputs again for the same case and parameters"),
        }
    )
}

fn number(measure: &Measure, value: f64) -> String {
    format!("{value:.*}", measure.digits)
}

/// Mean and deviation; also over how many of the cases, where it is not all of them.
fn spread_text(measure: &Measure, spread: Option<Spread>, cases: usize) -> String {
    let Some(s) = spread else {
        return "–".to_owned();
    };
    let mut text = number(measure, s.mean);
    if s.count > 1 {
        text = format!("{text} ± {}", number(measure, s.deviation));
    }
    match s.count < cases {
        true => format!("{text} ({} of {cases})", s.count),
        false => text,
    }
}

/// Whether every measure has a value in every case.
fn all_have_values(study: &Study, results: &Results) -> bool {
    let values = |v: usize, m: usize| results.values(study, v, m).iter().all(Option::is_some);
    (0..study.variants.len()).all(|v| (0..study.measures.len()).all(|m| values(v, m)))
}

/// The variant that is best in a measure, by its mean.
fn best(study: &Study, results: &Results, measure: usize, keep: &dyn Fn(usize) -> bool) -> Option<usize> {
    let sign = match study.measures[measure].better {
        Better::More => 1.0,
        Better::Less => -1.0,
        Better::Neither => return None,
    };
    let mean = |v: usize| results.spread(study, v, measure, keep).map(|s| sign * s.mean);
    let means = (0..study.variants.len()).filter_map(|v| Some((v, mean(v)?)));
    means.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(v, _)| v)
}

/// The study laid out like the published table, with the published numbers beside ours.
fn main_table(study: &Study, results: &Results) -> Table {
    let published = |measure: &Measure| {
        let others = study
            .paper
            .iter()
            .flat_map(|paper| paper.others.iter().map(|(_, numbers)| numbers));
        let own = study.variants.iter().map(|variant| &variant.paper);
        own.chain(others).any(|numbers| numbers.contains_key(&measure.name))
    };
    let mut head = vec!["variant".to_owned()];
    for measure in &study.measures {
        head.push(format!("{}{}", measure.label, measure.arrow()));
        if published(measure) {
            head.push("published".to_owned());
        }
    }
    let mut table = Table::new(head);
    let all = |_: usize| true;
    let bests: Vec<_> = (0..study.measures.len())
        .map(|m| best(study, results, m, &all))
        .collect();
    let beside = |measure: &Measure, numbers: &std::collections::BTreeMap<String, f64>| {
        numbers
            .get(&measure.name)
            .map_or("–".to_owned(), |n| number(measure, *n))
    };
    if let Some(paper) = &study.paper {
        for (label, numbers) in &paper.others {
            let mut row = vec![label.clone()];
            for measure in &study.measures {
                row.push("–".to_owned());
                if published(measure) {
                    row.push(beside(measure, numbers));
                }
            }
            table.row(row);
        }
    }
    for (v, variant) in study.variants.iter().enumerate() {
        let mut row = vec![variant.label.clone()];
        for (m, measure) in study.measures.iter().enumerate() {
            let text = spread_text(measure, results.spread(study, v, m, &all), study.cases.len());
            row.push(if bests[m] == Some(v) {
                format!("**{text}**")
            } else {
                text
            });
            if published(measure) {
                row.push(beside(measure, &variant.paper));
            }
        }
        table.row(row);
    }
    table
}

fn interval_text(measure: &Measure, interval: Option<Interval>) -> String {
    match interval {
        Some(i) => format!("[{}, {}]", signed(measure, i.low), signed(measure, i.high)),
        None => "[–]".to_owned(),
    }
}

fn signed(measure: &Measure, value: f64) -> String {
    let text = format!("{value:+.*}", measure.digits);
    // What rounds to nothing has no sign.
    match text
        .trim_start_matches(['+', '-'])
        .chars()
        .all(|c| matches!(c, '0' | '.'))
    {
        true => text.trim_start_matches(['+', '-']).to_owned(),
        false => text,
    }
}

fn differences(study: &Study, results: &Results, blocks: &mut Vec<Block>) {
    if study.variants.len() < 2 {
        return;
    }
    let baseline = &study.variants[study.baseline];
    blocks.push(Block::Heading(format!("Differences to {}", baseline.label)));
    let labels = study.measures.iter().map(|m| format!("{}{}", m.label, m.arrow()));
    let mut table = Table::new(std::iter::once("variant".to_owned()).chain(labels));
    for (v, variant) in study.variants.iter().enumerate().filter(|(v, _)| *v != study.baseline) {
        let mut row = vec![variant.label.clone()];
        for (m, measure) in study.measures.iter().enumerate() {
            row.push(match results.paired(study, v, study.baseline, m) {
                None => "–".to_owned(),
                Some(p) => {
                    let text = format!(
                        "{} {} ({}/{})",
                        signed(measure, p.mean),
                        interval_text(measure, p.interval),
                        p.larger,
                        p.smaller
                    );
                    match p.interval.is_some_and(|i| i.excludes_zero()) {
                        true => format!("**{text}**"),
                        false => text,
                    }
                }
            });
        }
        table.row(row);
    }
    blocks.push(Block::Table(table));
    blocks.push(Block::Text(
        "Mean of the differences case by case, 95 % bootstrap interval, and in how many cases the variant is larger / \
         smaller. Bold: the interval excludes 0."
            .to_owned(),
    ));
}

fn agreement(study: &Study, results: &Results, blocks: &mut Vec<Block>) {
    let pairs = compare(study, results);
    let Some(paper) = study.paper.as_ref().filter(|_| !pairs.is_empty()) else {
        return;
    };
    blocks.push(Block::Heading("What agrees in order, and what does not".to_owned()));
    let count = |verdict: Verdict| pairs.iter().filter(|pair| pair.verdict == verdict).count();
    blocks.push(Block::Text(format!(
        "Of {} pairs of rows in {}, {} come in the published order here, {} in the opposite order, {} are not resolved by \
         {} cases{}.",
        pairs.len(),
        paper.source,
        count(Verdict::Agrees),
        count(Verdict::Disagrees),
        count(Verdict::Open),
        study.cases.len(),
        match count(Verdict::Equal) {
            0 => String::new(),
            n => format!(", {n} are equal here"),
        }
    )));
    let mut table = Table::new(["published order", "measure", "difference here", "verdict"]);
    for pair in &pairs {
        let measure = &study.measures[pair.measure];
        table.row([
            format!(
                "{} > {}",
                study.variants[pair.larger].label, study.variants[pair.smaller].label
            ),
            measure.label.clone(),
            format!(
                "{} {}",
                signed(measure, pair.difference),
                interval_text(measure, pair.interval)
            ),
            pair.verdict.word().to_owned(),
        ]);
    }
    blocks.push(Block::Table(table));
}

fn group_table(study: &Study, results: &Results, group: &str) -> Table {
    let labels = study.measures.iter().map(|m| format!("{}{}", m.label, m.arrow()));
    let mut table = Table::new(
        [group.to_owned(), "variant".to_owned(), "cases".to_owned()]
            .into_iter()
            .chain(labels),
    );
    for value in study.group_values(group) {
        let inside = |case: usize| study.cases[case].field(group).unwrap_or("not given") == value;
        let count = (0..study.cases.len()).filter(|case| inside(*case)).count();
        let bests: Vec<_> = (0..study.measures.len())
            .map(|m| best(study, results, m, &inside))
            .collect();
        for (v, variant) in study.variants.iter().enumerate() {
            let mut row = vec![value.clone(), variant.label.clone(), count.to_string()];
            for (m, measure) in study.measures.iter().enumerate() {
                let text = spread_text(measure, results.spread(study, v, m, &inside), count);
                row.push(if bests[m] == Some(v) {
                    format!("**{text}**")
                } else {
                    text
                });
            }
            table.row(row);
        }
    }
    table
}

fn failures(study: &Study, results: &Results, blocks: &mut Vec<Block>) {
    let failed = results.rows.iter().filter_map(|row| {
        let failure = row.failure.as_ref()?.lines().next()?;
        Some(format!(
            "{} · {}: {failure}",
            study.cases[row.case].name, study.variants[row.variant].label
        ))
    });
    let failed: Vec<String> = failed.collect();
    if !failed.is_empty() {
        blocks.push(Block::Heading("What failed".to_owned()));
        blocks.push(Block::List(failed));
    }
}
