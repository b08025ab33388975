//! What is left out because a parameter or the picture makes it irrelevant changes no bit of the result.

use gear_tests::{Desk, Record};
use serde_json::Value;

use crate::MAIN;

/// Parameters under which every node that can leave something out does.
const SPARING: &[&[&str]] = &[
    // No relighting: no translation, no ratio chain.
    &["--set", "recompose.beta=0"],
    // Relighting with everything in it that can be trivial.
    &[
        "--set",
        "recompose.beta=0.5",
        "--set",
        "pyramid.tau=1",
        "--set",
        "gain.mode={fixed: {alpha: 1}}",
    ],
];

fn run(desk: &Desk, out: &str, flags: &[&str]) -> Record {
    desk.gear(&[MAIN, flags, &["--no-cache", "--out", out]].concat())
        .exits(0);
    desk.record(out)
}

/// `node.port` of every port that a run did without, and of every node that was left out.
fn left_out(record: &Record) -> Vec<String> {
    let mut found = Vec::new();
    for node in record.0["nodes"].as_array().into_iter().flatten() {
        let id = node["id"].as_str().unwrap_or_default();
        if node["status"] == "left-out" {
            assert!(
                node["reason"].as_str().is_some_and(|reason| reason.len() > 5),
                "{id} has no reason"
            );
            found.push(id.to_owned());
        }
        for port in node["elided"].as_array().into_iter().flatten() {
            assert_ne!(port["reason"], Value::Null);
            found.push(format!("{id}.{}", port["port"].as_str().unwrap_or_default()));
        }
    }
    found
}

#[test]
fn the_main_job_with_and_without() {
    let desk = Desk::new();
    let expected: [&[&str]; 2] = [
        &["edges", "translate", "ratio", "pyramid", "gain", "recompose.ratio"],
        &["pyramid.edges", "gain.smooth"],
    ];
    for (i, (flags, expected)) in SPARING.iter().zip(expected).enumerate() {
        let sparing = run(&desk, &format!("sparing{i}"), flags);
        let full = run(&desk, &format!("full{i}"), &[*flags, &["--no-elision"]].concat());
        assert_eq!(sparing.outputs(), full.outputs(), "{flags:?}");
        let found = left_out(&sparing);
        for name in expected {
            assert!(found.iter().any(|found| found == name), "{name} is not among {found:?}");
        }
        assert_eq!(
            left_out(&full),
            Vec::<String>::new(),
            "nothing is left out with --no-elision"
        );
        assert_eq!(full.0["elision"], false);
    }
}

#[test]
fn a_plan_tells_them_with_their_reasons() {
    let desk = Desk::new();
    let plan = |flags: &[&str]| {
        let arguments = [&["plan"], &MAIN[1..], SPARING[0], &["--no-cache"], flags].concat();
        desk.gear(&arguments).exits(0).stdout
    };
    let sparing = plan(&[]);
    assert!(sparing.contains("does without `ratio`: beta = 0"), "{sparing}");
    assert!(
        sparing
            .lines()
            .any(|line| line.starts_with("translate") && line.contains("left out")),
        "{sparing}"
    );
    let full = plan(&["--no-elision"]);
    assert!(!full.contains("does without") && !full.contains("left out"), "{full}");
}
