//! Blinding, order and the way from answers to shares.

use std::collections::{BTreeMap, BTreeSet};

use super::*;

fn cases(count: usize, methods: &[String]) -> Vec<Case> {
    (0..count)
        .map(|i| Case {
            name: format!("secret-case-{i}"),
            tradition: if i % 2 == 0 { "Mural".into() } else { "Thangka".into() },
            painting: Some(vec![1, 2, i as u8]),
            turns: methods
                .iter()
                .map(|m| {
                    let turn = Turn {
                        angles: vec![0.0, 30.0],
                        frames: vec![vec![i as u8; 3], vec![i as u8; 4]],
                    };
                    (m.clone(), turn)
                })
                .collect(),
        })
        .collect()
}

fn methods() -> Vec<String> {
    ["ours-secret", "raw-secret", "retinex-secret"]
        .map(str::to_owned)
        .to_vec()
}

#[test]
fn the_page_names_no_method_and_no_case() {
    let cases = cases(4, &methods());
    let (key, sheets) = draw(&cases, &methods(), 7, 6);
    let page = page("Which is better?", &cases, &key, &sheets).unwrap();
    for word in methods()
        .iter()
        .chain(cases.iter().map(|case| &case.name))
        .map(String::as_str)
        .chain(["Mural", "Thangka"])
    {
        assert!(!page.contains(word), "{word}");
    }
    assert!(key.tokens.keys().all(|token| page.contains(token.as_str())));
    assert!(
        !page.contains("http:") && !page.contains("https:"),
        "nothing is fetched"
    );
}

#[test]
fn what_the_page_holds_is_in_the_order_of_tokens() {
    let cases = cases(5, &methods());
    let (key, sheets) = draw(&cases, &methods(), 7, 6);
    let page = page("", &cases, &key, &sheets).unwrap();
    let pictures = page.find("\"pictures\"").unwrap();
    let places: Vec<_> = key
        .tokens
        .keys()
        .map(|token| page[pictures..].find(&format!("\"{token}\"")).unwrap())
        .collect();
    assert!(places.is_sorted(), "tokens are random, so their order tells nothing");
}

#[test]
fn every_method_stands_in_each_place_once_in_as_many_sheets_as_there_are_methods() {
    let cases = cases(5, &methods());
    let (key, sheets) = draw(&cases, &methods(), 11, 6);
    for trial in 0..5 {
        for turn in sheets.chunks(3) {
            for method in methods() {
                let place = |sheet: &Sheet| {
                    let trial = sheet.iter().find(|t| t.trial == trial).unwrap();
                    trial
                        .tokens
                        .iter()
                        .position(|token| key.tokens[token].method == method)
                        .unwrap()
                };
                let places: BTreeSet<_> = turn.iter().map(place).collect();
                assert_eq!(places.len(), 3);
            }
        }
    }
}

#[test]
fn the_order_is_the_seed_s_and_differs_from_sheet_to_sheet() {
    let cases = cases(8, &methods());
    let (key, sheets) = draw(&cases, &methods(), 3, 4);
    assert_eq!(draw(&cases, &methods(), 3, 4), (key.clone(), sheets.clone()));
    let (other, otherwise) = draw(&cases, &methods(), 4, 4);
    assert_ne!(sheets, otherwise);
    assert!(
        other.tokens.keys().all(|token| !key.tokens.contains_key(token)),
        "tokens tell nothing of another ballot"
    );
    let order = |sheet: &Sheet| sheet.iter().map(|t| t.trial).collect::<Vec<_>>();
    assert_ne!(order(&sheets[0]), order(&sheets[1]));
    for sheet in &sheets {
        let mut all = order(sheet);
        all.sort_unstable();
        assert_eq!(all, (0..8).collect::<Vec<_>>());
    }
}

/// Answers as the page saves them: of every trial on the sheet, who prefers `of(case)`.
fn answers(
    key: &Key,
    sheet: &Sheet,
    person: &str,
    expertise: &str,
    of: impl Fn(&Meaning) -> bool,
) -> (PathBuf, Answers) {
    let mut said = Vec::new();
    for trial in sheet {
        for (question, _) in QUESTIONS {
            let place = trial.tokens.iter().position(|token| of(&key.tokens[token]));
            let choice = place.map(|place| trial.tokens[place].clone());
            said.push(
                serde_json::json!({"trial": trial.trial, "question": question, "choice": choice, "place": place}),
            );
        }
    }
    let answers = serde_json::json!({
        "ballot_answers": 1, "ballot": key.ballot, "participant": person, "expertise": expertise, "sheet": 0, "answers": said,
    });
    (
        PathBuf::from(format!("{person}.json")),
        serde_json::from_value(answers).unwrap(),
    )
}

fn share<'t>(tally: &'t Tally, question: &str, group: &str, method: &str) -> &'t Share {
    let mut shares = tally.shares.iter();
    shares
        .find(|s| s.question == question && s.group == group && s.method == method)
        .unwrap()
}

#[test]
fn shares_are_unblinded_and_counted_by_tradition_and_expertise() {
    let cases = cases(4, &methods());
    let (key, sheets) = draw(&cases, &methods(), 5, 3);
    let mural = |m: &Meaning| {
        m.method
            == if m.tradition == "Mural" {
                "ours-secret"
            } else {
                "raw-secret"
            }
    };
    let files = [
        answers(&key, &sheets[0], "p1", "heritage", mural),
        answers(&key, &sheets[1], "p2", "public", |m| m.method == "retinex-secret"),
        answers(&key, &sheets[2], "p3", "public", |_| false),
    ];
    let tally = tally(&key, &files).unwrap();
    assert_eq!(tally.persons, 3);
    let all = share(&tally, "depth", "all", "ours-secret");
    assert_eq!((all.votes, all.of, all.undecided, all.persons), (2, 8, Some(4), 2));
    assert_eq!(share(&tally, "overall", "tradition Mural", "ours-secret").share, 0.5);
    assert_eq!(share(&tally, "overall", "tradition Thangka", "ours-secret").share, 0.0);
    assert_eq!(share(&tally, "aesthetics", "expertise heritage", "raw-secret").votes, 2);
    assert_eq!(
        share(&tally, "aesthetics", "expertise public", "retinex-secret").share,
        1.0
    );
    assert_eq!(all.bootstrap, None, "two persons are too few");
    assert!(all.wilson.low < 0.25 && all.wilson.high > 0.25);
    assert_eq!(tally.places.iter().sum::<usize>(), 24);
    let text = tally.text();
    assert!(text.contains("ours-secret") && text.contains(", 3 persons\n"), "{text}");
}

#[test]
fn who_answers_again_counts_once_and_strangers_are_refused() {
    let cases = cases(2, &methods());
    let (key, sheets) = draw(&cases, &methods(), 5, 3);
    let first = answers(&key, &sheets[0], "p1", "public", |m| m.method == "ours-secret");
    let again = answers(&key, &sheets[0], "p1", "public", |m| m.method == "raw-secret");
    let counted = tally(&key, &[first.clone(), again]).unwrap();
    assert_eq!(share(&counted, "depth", "all", "raw-secret").share, 1.0);
    assert_eq!((counted.persons, counted.notes.len()), (1, 1));
    let text = counted.text();
    assert!(
        text.contains(", 1 person\n") && text.contains(" of 1 person\n"),
        "{text}"
    );
    let (other, _) = draw(&cases, &methods(), 6, 3);
    assert!(matches!(
        tally(&other, std::slice::from_ref(&first)),
        Err(BallotError::Foreign { .. })
    ));
    let mut forged = first;
    forged.1.answers[0].choice = Some("000000000000".into());
    assert!(matches!(tally(&key, &[forged]), Err(BallotError::Token { .. })));
}

#[test]
fn run_folders_become_cases_and_what_is_not_paired_is_refused() {
    let root = tempfile::tempdir().unwrap();
    let run = |method: &str, case: &str| {
        let folder = root.path().join(method).join(case);
        std::fs::create_dir_all(folder.join("orbit")).unwrap();
        for yaw in ["yaw+0", "yaw+90", "yaw+180"] {
            let picture = image::RgbImage::from_pixel(40, 30, image::Rgb([90, 120, 30]));
            picture.save(folder.join(format!("orbit/{yaw}.png"))).unwrap();
        }
        let record = serde_json::json!({
            "outputs": [{"name": "orbit", "type": "Views"}],
            "files": ["orbit/yaw+0.png", "orbit/yaw+90.png", "orbit/yaw+180.png"],
            "nodes": [{"input": true, "type": "Image", "source": "sample:vessel"}],
        });
        std::fs::write(folder.join("run.json"), record.to_string()).unwrap();
    };
    for (method, case) in [("a", "one"), ("a", "two"), ("b", "one")] {
        run(method, case);
    }
    let folders: Vec<_> = ["a", "b"].map(|m| (m.to_owned(), root.path().join(m))).to_vec();
    let given = |cases: &[&str]| Given {
        size: 32,
        frames: 2,
        cases: cases.iter().map(ToString::to_string).collect(),
        methods: Vec::new(),
    };
    let found = from_folders(&folders, &BTreeMap::new(), &given(&[]));
    assert!(matches!(found, Err(BallotError::Unpaired { .. })), "{found:?}");
    let Collected { methods, cases, .. } = from_folders(&folders, &BTreeMap::new(), &given(&["one"])).unwrap();
    assert_eq!(methods, ["a", "b"]);
    assert_eq!((cases.len(), cases[0].turns["a"].frames.len()), (1, 2));
    assert!(cases[0].painting.is_some(), "the sample is painted");
    let alone = from_folders(&folders[..1], &BTreeMap::new(), &given(&[]));
    assert!(matches!(alone, Err(BallotError::Nothing(_))));
    let misspelt = from_folders(&folders, &BTreeMap::new(), &given(&["oen"])).unwrap_err();
    assert!(misspelt.to_string().contains("did you mean `one`?"), "{misspelt}");

    let manifest = root.path().join("ballot.json");
    let text = serde_json::json!({"ballot": 1, "cases": [{"name": "one", "tradition": "Mural", "methods": {
        "a": ["a/one/orbit/yaw+0.png"], "b": ["b/one/orbit/yaw+0.png"]}}]});
    std::fs::write(&manifest, text.to_string()).unwrap();
    let found = from_manifest(&manifest, &given(&[])).unwrap();
    assert_eq!((found.methods.len(), found.cases[0].tradition.as_str()), (2, "Mural"));
}

#[test]
fn the_results_of_a_study_become_cases_and_what_failed_is_told() {
    let root = tempfile::tempdir().unwrap();
    for file in ["paintings/one.jpg", "views/front.jpg", "views/side.jpg"] {
        let path = root.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::RgbImage::from_pixel(40, 30, image::Rgb([90, 120, 30]))
            .save(path)
            .unwrap();
    }
    let views =
        serde_json::json!([{"name": "yaw-90", "file": "views/side.jpg"}, {"name": "yaw+0", "file": "views/front.jpg"}]);
    let row = |case: &str, variant: &str| serde_json::json!({"case": case, "variant": variant, "failure": null, "views": views});
    let study = |rows: serde_json::Value| {
        serde_json::json!({
            "format": 1, "study": "s.yaml", "title": "S",
            "cases": [{"name": "one", "painting": "paintings/one.jpg", "fields": {"tradition": "Mural", "artist": "x"}},
                      {"name": "two", "painting": null, "fields": {}}],
            "variants": [{"name": "bare", "label": "Bare"}, {"name": "full", "label": "Full"}, {"name": "other", "label": "O"}],
            "rows": rows,
        })
    };
    let file = root.path().join(STUDY);
    let write = |rows: serde_json::Value| std::fs::write(&file, study(rows).to_string()).unwrap();
    let given = |methods: &[&str]| Given {
        size: 32,
        frames: 9,
        cases: Vec::new(),
        methods: methods.iter().map(ToString::to_string).collect(),
    };
    let failed = serde_json::json!({"case": "two", "variant": "full", "failure": "no light\nat all", "views": []});
    write(serde_json::json!([
        row("one", "bare"),
        row("one", "full"),
        row("one", "other"),
        row("two", "bare"),
        failed
    ]));
    let found = from_study(&file, &given(&["full", "bare"])).unwrap();
    assert_eq!(found.methods, ["bare", "full"]);
    assert_eq!(found.cases.len(), 1);
    let case = &found.cases[0];
    assert_eq!((case.name.as_str(), case.tradition.as_str()), ("one", "Mural"));
    assert_eq!(case.turns["full"].angles, [-90.0, 0.0]);
    assert!(case.painting.is_some());
    assert_eq!(
        found.notes,
        ["`two` is left out, as `full` made nothing of it: no light"]
    );
    assert_eq!(from_study(&file, &given(&[])).unwrap().methods.len(), 3);
    let misspelt = from_study(&file, &given(&["fulll"])).unwrap_err().to_string();
    assert!(misspelt.contains("did you mean `full`?"), "{misspelt}");

    write(serde_json::json!([failed_row()]));
    let told = from_study(&file, &given(&[])).unwrap_err().to_string();
    assert!(
        told.contains("kept no views") && told.contains("views: orbit"),
        "{told}"
    );
}

fn failed_row() -> serde_json::Value {
    serde_json::json!({"case": "one", "variant": "bare", "views": []})
}
