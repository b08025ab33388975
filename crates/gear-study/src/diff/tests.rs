//! Two runs of a small graph, compared by what they left.

use std::path::Path;
use std::sync::Arc;

use gear_graph::{GraphSource, Input, Registry, Report, Run, Store, Value};
use serde_json::json;

use super::*;
use crate::diff::outputs::Values;
use crate::testing::{ANSWER, registry};

/// Runs the graph with a factor, and leaves a record in the folder.
fn run(folder: &Path, store: &Arc<Store>, factor: f64) -> Record {
    let registry = registry();
    let text = ANSWER.replace("FACTOR", &factor.to_string());
    let graph = GraphSource::new("answer.yaml", text).check(&registry).unwrap();
    let note = Input::Value(gear_graph::AnyValue::new(Report(json!({"x": 3.0}))));
    let outcome = Run::new(&graph)
        .store(Arc::clone(store))
        .input("note", note)
        .go()
        .unwrap();
    std::fs::create_dir_all(folder).unwrap();
    let record = Report::new(&outcome.report).unwrap();
    std::fs::write(folder.join("run.json"), record.encode().unwrap()).unwrap();
    Record::open(folder).unwrap()
}

fn compared(a: &Record, b: &Record, registry: &Registry) -> Comparison {
    compare(a, b, &Values::of(a, b, None, registry))
}

#[test]
fn a_changed_parameter_is_followed_to_the_outputs() {
    let root = tempfile::tempdir().unwrap();
    let store = Arc::new(Store::open(root.path().join("store")));
    let a = run(&root.path().join("a"), &store, 2.0);
    let b = run(&root.path().join("b"), &store, 2.5);
    store.flush();
    let comparison = compared(&a, &b, &registry());
    let fate = |id: &str| comparison.nodes.iter().find(|node| node.id == id).unwrap().fate;
    assert_eq!(fate("scaled"), Fate::ChangedHere);
    // 3 × 2 and 3 × 2.5 round to 6 and 8; the sign of both is the same.
    assert_eq!(fate("rounded"), Fate::ChangedBefore);
    assert_eq!(fate("sign"), Fate::SameResult);
    let changed = &comparison
        .nodes
        .iter()
        .find(|node| node.id == "scaled")
        .unwrap()
        .changed;
    assert_eq!(changed.len(), 1);
    assert_eq!(
        (changed[0].what.as_str(), changed[0].a.as_str(), changed[0].b.as_str()),
        ("factor", "2.0", "2.5")
    );
    let output = |name: &str| comparison.outputs.iter().find(|output| output.name == name).unwrap();
    assert!(output("sign").same && !output("rounded").same);
    assert_eq!(output("rounded").norms[0], ("max".to_owned(), 2.0));
    assert!(!comparison.same_outputs());
    let told = text::text(&comparison, false);
    for says in [
        "scaled.factor: 2.0 → 2.5",
        "computed from other things, and the same",
        "rounded (Number): max 2",
        "1 of 2 outputs is the same",
    ] {
        assert!(told.contains(says), "{says} in {told}");
    }
}

#[test]
fn a_method_that_became_another_is_one_change() {
    let (a, b) = (
        json!({"method": "auto", "size": 3, "inner": {"canny": {"low": 0.1, "high": 0.3}}}),
        json!({"method": {"box": {"x0": 0.1, "x1": 0.9}}, "size": 3, "inner": {"canny": {"low": 0.2, "high": 0.3}}}),
    );
    let told = |a, b| -> Vec<String> {
        let changes = record::changes(a, b).into_iter();
        changes.map(|(what, a, b)| format!("{what}: {a} → {b}")).collect()
    };
    let expected = ["inner.canny.low: 0.1 → 0.2", "method: auto → {box: {x0: 0.1, x1: 0.9}}"];
    assert_eq!(told(&a, &b), expected);
    assert_eq!(told(&json!(null), &json!({"size": 3})), ["size:  → 3"]);
}

#[test]
fn of_many_numbers_the_largest_differences_are_told_and_counts_are_whole() {
    let numbers = (0..100).map(|i| {
        let b = if i == 50 { 2e6 } else { 1_000_000.0 + f64::from(i) };
        (format!("count.{i}"), Some(1_000_000.0 - 1.0), Some(b))
    });
    let mut numbers: Vec<_> = numbers.collect();
    numbers.swap(0, 50); // they come sorted
    let comparison = Comparison {
        outputs: vec![outputs::OutputDifference {
            name: "report".to_owned(),
            type_name: "Report".to_owned(),
            numbers,
            ..Default::default()
        }],
        ..Comparison::default()
    };
    let told = text::text(&comparison, false);
    assert!(told.contains("count.50: 999999 → 2000000  (+1000001)"), "{told}");
    assert!(
        told.contains("… and 80 more numbers differ, by less; --all shows them"),
        "{told}"
    );
    assert_eq!(told.lines().count(), 23, "{told}");
    assert!(text::text(&comparison, true).contains("count.99"));
}

#[test]
fn a_run_is_the_same_as_itself() {
    let root = tempfile::tempdir().unwrap();
    let store = Arc::new(Store::open(root.path().join("store")));
    let a = run(&root.path().join("a"), &store, 2.0);
    let b = run(&root.path().join("b"), &store, 2.0);
    let comparison = compared(&a, &b, &registry());
    assert!(comparison.same_outputs() && comparison.facts.is_empty());
    assert!(comparison.nodes.iter().all(|node| node.changed.is_empty()));
}

#[test]
fn what_is_no_record_says_so() {
    let root = tempfile::tempdir().unwrap();
    let told = |path: &Path| Record::open(path).unwrap_err().to_string();
    assert!(told(root.path()).contains("run.json"));
    let file = root.path().join("x.json");
    std::fs::write(&file, "{}").unwrap();
    assert!(told(&file).contains("no `nodes`"));
    std::fs::write(&file, "no").unwrap();
    assert!(told(&file).contains("no JSON"));
}
