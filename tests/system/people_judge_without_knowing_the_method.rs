//! A ballot from two methods' runs: a page that names no method, and a count of answers that does.

use gear_tests::Desk;
use serde_json::{Value, json};

#[test]
fn a_ballot_is_made_from_runs_and_its_answers_are_counted() {
    let desk = Desk::new();
    for (method, graph) in [("gear-method", "@gear"), ("raw-method", "@baselines/raw")] {
        let out = format!("{method}/vessel");
        let mut arguments = vec![
            "run",
            graph,
            "--input",
            "painting=sample:vessel",
            "--out",
            &out,
            "--output",
            "orbit",
        ];
        arguments.extend([
            "--set",
            "painting.size=64",
            "--set",
            "orbit.orbit=4",
            "--set",
            "orbit.size=48",
        ]);
        if graph == "@gear" {
            arguments.extend(["--set", "refine.color_iterations=2", "--set", "refine.iterations=2"]);
        }
        desk.gear(&arguments).exits(0);
    }
    desk.file("about.csv", "case,tradition\nvessel,Still life\n");
    let ballot = [
        "ballot",
        "a=gear-method",
        "b=raw-method",
        "--about",
        "about.csv",
        "--sheets",
        "2",
    ];
    desk.gear(&ballot).exits(0);
    // The same ballot may be made again; another one does not take its key away.
    desk.gear(&ballot).exits(0);
    let before = desk.listing("");
    let other = [&ballot[..], &["--seed", "2"]].concat();
    desk.gear(&other)
        .exits(2)
        .says("the key of another ballot")
        .says("--out");
    assert_eq!(desk.listing(""), before);
    desk.gear(&[&other[..], &["--out", "second.html"]].concat()).exits(0);
    let page = std::fs::read_to_string(desk.path("ballot.html")).unwrap();
    assert_eq!(
        page.matches("data:image/jpeg").count(),
        2 * 4 + 1,
        "two turns of four views, and the painting"
    );
    for word in ["gear-method", "raw-method", "vessel", "Still life"] {
        assert!(!page.contains(word), "{word}");
    }
    let key: Value = gear_tests::json(&desk.path("ballot.key.json"));
    let tokens = key["tokens"].as_object().unwrap();
    let (token, _) = tokens.iter().find(|(_, meaning)| meaning["method"] == "a").unwrap();
    let answers = json!({"ballot_answers": 1, "ballot": key["ballot"], "participant": "p", "expertise": "public", "sheet": 0,
        "answers": [{"trial": 0, "question": "depth", "choice": token, "place": 1}]});
    desk.file("p.json", answers.to_string());
    let tally = desk
        .gear(&["ballot", "--tally", "--key", "ballot.key.json", "p.json"])
        .exits(0)
        .stdout;
    assert!(
        tally.contains("tradition Still life") && tally.contains("100.0 %"),
        "{tally}"
    );
    assert_eq!(
        desk.gear(&["ballot", "--tally", "p.json"]).code,
        Some(2),
        "without the key nothing can be counted"
    );
    assert!(
        desk.gear(&["ballot", "a=gear-method"])
            .exits(2)
            .stderr
            .contains("two methods or more")
    );
}
