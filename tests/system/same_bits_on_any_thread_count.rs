//! The same bits on any number of threads and on a second run.

use std::path::Path;

use gear_tests::Desk;

use crate::MAIN;

#[test]
fn the_main_job_with_one_two_and_eight_threads() {
    let desk = Desk::new();
    let times = std::cell::Cell::new(0);
    let run = |jobs: &str| {
        times.set(times.get() + 1);
        let out = format!("out{}", times.get());
        desk.gear(&[MAIN, &["--no-cache", "--jobs", jobs, "--out", &out]].concat())
            .exits(0);
        desk.record(&out)
    };
    let one = run("1");
    assert!(one.outputs().len() >= 6);
    for jobs in ["2", "8", "1"] {
        let other = run(jobs);
        let last = format!("out{}", times.get());
        assert_eq!(one.outputs(), other.outputs(), "{jobs} threads");
        let scene = |out: &str| std::fs::read(desk.path(out).join("scene.ply")).unwrap();
        assert!(scene("out1") == scene(&last), "{jobs} threads");
    }
}

/// `EdgeDetect` lives in `nodes/edge-detect`; `Verdict` beside the node that it reads.
fn folder(node: &str) -> String {
    if node == "Verdict" {
        return folder("Judge");
    }
    let mut name = String::new();
    for (i, c) in node.char_indices() {
        if c.is_ascii_uppercase() && i > 0 {
            name.push('-');
        }
        name.push(c.to_ascii_lowercase());
    }
    name
}

fn sources(folder: &Path, text: &mut String) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, text);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            *text += &std::fs::read_to_string(&path).unwrap();
        }
    }
}

#[test]
fn every_registered_node_has_a_test_of_its_own_that_says_so() {
    let nodes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../nodes");
    let registry = gear_cli::registry();
    assert!(registry.nodes().count() >= 13);
    for node in registry.nodes().filter(|node| node.spec.deterministic) {
        let mut text = String::new();
        sources(&nodes.join(folder(node.spec.name)), &mut text);
        assert!(
            text.contains("assert_pure("),
            "{} promises the same bits; its crate must show it with `gear_graph::testing::assert_pure`",
            node.spec.name
        );
    }
}
