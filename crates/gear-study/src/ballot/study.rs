//! Results of a study → cases: its variants are the methods, and its own pictures are shown.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::collect::{angle, failed, jpeg, paired, read, turn};
use super::{BallotError, Case, Collected, Given};

/// What a study writes for other programs, in its output folder.
pub const STUDY: &str = "study.json";

#[derive(Deserialize)]
struct Results {
    cases: Vec<StudyCase>,
    variants: Vec<Named>,
    rows: Vec<Row>,
}

#[derive(Deserialize)]
struct Named {
    name: String,
}

#[derive(Deserialize)]
struct StudyCase {
    name: String,
    #[serde(default)]
    painting: Option<PathBuf>,
    #[serde(default)]
    fields: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct Row {
    case: String,
    variant: String,
    #[serde(default)]
    failure: Option<String>,
    #[serde(default)]
    views: Vec<View>,
}

#[derive(Deserialize)]
struct View {
    name: String,
    file: PathBuf,
}

/// The cases of a study's results, `study.json`; pictures lie in its folder. A case of which a variant has no views, because
/// it failed, is left out with a note. The field `tradition` of the cases is their tradition.
pub fn from_study(file: &Path, given: &Given) -> Result<Collected, BallotError> {
    let results: Results = read(file)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let names: Vec<String> = results.cases.iter().map(|case| case.name.clone()).collect();
    let variants: Vec<String> = results.variants.iter().map(|variant| variant.name.clone()).collect();
    given.check(&names, &variants)?;
    if results.rows.iter().all(|row| row.views.is_empty()) {
        let cause =
            "the study kept no views; name an output of type Views in it, such as `views: orbit`, and run it again";
        return Err(failed(file, cause));
    }
    let mut rows: BTreeMap<(&str, &str), &Row> = BTreeMap::new();
    for row in &results.rows {
        rows.insert((&row.case, &row.variant), row);
    }
    let mut notes = Vec::new();
    let mut cases = Vec::new();
    for case in results.cases.iter().filter(|case| given.wants_case(&case.name)) {
        let mut turns = BTreeMap::new();
        for variant in variants.iter().filter(|variant| given.wants_method(variant)) {
            let row = rows.get(&(&case.name, variant));
            let Some(row) = row.filter(|row| !row.views.is_empty()) else {
                let why = row.and_then(|row| row.failure.as_deref()).unwrap_or("it has no views");
                let why = why.lines().next().unwrap_or_default();
                notes.push(format!(
                    "`{}` is left out, as `{variant}` made nothing of it: {why}",
                    case.name
                ));
                break;
            };
            let views = row
                .views
                .iter()
                .map(|view| (angle(Path::new(&view.name)), folder.join(&view.file)));
            turns.insert(variant.clone(), turn(views.collect(), given)?);
        }
        if turns.len() < variants.iter().filter(|variant| given.wants_method(variant)).count() {
            continue;
        }
        let painting = case
            .painting
            .as_ref()
            .map(|painting| jpeg(&folder.join(painting), given.size));
        cases.push(Case {
            name: case.name.clone(),
            tradition: case.fields.get("tradition").cloned().unwrap_or_default(),
            painting: painting.transpose()?,
            turns,
        });
    }
    if let (true, Some(note)) = (cases.is_empty(), notes.first()) {
        return Err(failed(file, format!("no case is left: {note}")));
    }
    Ok(Collected {
        notes,
        ..paired(cases)?
    })
}
