//! The page on which people judge: one file with its pictures, styles and script.

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, Value, context};
use serde_json::json;

use super::{BallotError, Case, EXPERTISE, Key, QUESTIONS, Sheet};

/// The page of a ballot.
pub fn page(title: &str, cases: &[Case], key: &Key, sheets: &[Sheet]) -> Result<String, BallotError> {
    let uri = |jpeg: &Vec<u8>| format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg));
    // A map by token: its order says nothing of methods or cases.
    let mut pictures = BTreeMap::new();
    let mut paintings: BTreeMap<usize, String> = BTreeMap::new();
    let trial_of = |token: &str| {
        let mut trials = sheets.iter().flatten();
        trials
            .find(|trial| trial.tokens.iter().any(|t| t == token))
            .map(|trial| trial.trial)
    };
    for (token, meaning) in &key.tokens {
        let Some(case) = cases.iter().find(|case| case.name == meaning.case) else {
            continue;
        };
        let Some(turn) = case.turns.get(&meaning.method) else {
            continue;
        };
        let frames: Vec<_> = turn.frames.iter().map(uri).collect();
        pictures.insert(token, json!({"angles": turn.angles, "frames": frames}));
        if let (Some(trial), Some(painting)) = (trial_of(token), &case.painting) {
            paintings.insert(trial, uri(painting));
        }
    }
    let data = json!({
        "ballot": key.ballot,
        "title": title,
        "questions": QUESTIONS,
        "expertise": EXPERTISE,
        "sheets": sheets,
        "pictures": pictures,
        "paintings": paintings,
    });
    let mut environment = Environment::new();
    environment.add_template("ballot.html", include_str!("page.html"))?;
    Ok(environment.get_template("ballot.html")?.render(context! {
        title => title,
        script => Value::from_safe_string(include_str!("ballot.js").to_owned()),
        // Within a script element only `</` could end the data.
        data => Value::from_safe_string(data.to_string().replace("</", "<\\/")),
    })?)
}
