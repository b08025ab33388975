//! Curves of a small graph.

use std::path::Path;
use std::sync::Arc;

use gear_graph::{Cancel, Library, Run, Store};

use super::front::better_than_default;
use super::*;
use crate::study::Host;
use crate::testing::{ANSWER, Notes, registry};

const CURVE: &str = "\
curve: 1
title: Units
graph: '@answer'
picture: 'sample:two,seed=3'
set: {scaled.factor: 1.7}
knobs: {unit: {at: rounded.unit, values: [4, 2, 0.5]}}
reference: {rounded.unit: 0.001}
time: rounded
error: {of: rounded, norm: abs}
operations: {knob: unit}
";

fn plan(text: &str) -> Result<Plan, gear_graph::Mistakes> {
    let library = Library::holding([("answer", ANSWER.replace("FACTOR", "2"))]);
    Plan::read("units.yaml", text, &library, &registry(), &Notes)
}

fn measure(plan: &Plan) -> Curve {
    fn as_it_is(run: Run<'_>) -> Run<'_> {
        run.jobs(1)
    }
    let folder = tempfile::tempdir().unwrap();
    let host = Host {
        samples: &Notes,
        store: Arc::new(Store::open(folder.path())),
        lend: &as_it_is,
        cancel: Cancel::new(),
    };
    plan.measure(&host, "a test", &mut |_| {}).unwrap()
}

#[test]
fn errors_are_taken_against_the_reference_and_the_default_is_added() {
    let curve = measure(&plan(CURVE).unwrap());
    let labels: Vec<_> = curve.points.iter().map(|point| point.label.as_str()).collect();
    assert_eq!(labels, ["unit = 1.0", "unit = 4", "unit = 2", "unit = 0.5"]);
    assert!(curve.points[0].default && !curve.points[1].default);
    // x = 2.3 · 1.7 = 3.91.
    let errors: Vec<_> = curve
        .points
        .iter()
        .map(|point| (point.error * 1000.0).round())
        .collect();
    assert_eq!(errors, [90.0, 90.0, 90.0, 90.0]);
    assert_eq!(curve.points[1].operations, Some(4.0));
    assert!(
        curve
            .points
            .iter()
            .all(|point| point.seconds.is_finite() && point.seconds >= 0.0)
    );
    assert_eq!(curve.norm, "abs of rounded, against rounded.unit = 0.001");
    assert_eq!(Curve::parse(&curve.csv()).unwrap().points.len(), 4);
}

#[test]
fn a_default_among_the_values_is_marked_and_not_added() {
    let curve = measure(&plan(&CURVE.replace("[4, 2, 0.5]", "[4, 1, 0.5]")).unwrap());
    let defaults: Vec<_> = curve.points.iter().map(|point| point.default).collect();
    assert_eq!(defaults, [false, true, false]);
}

#[test]
fn every_mistake_is_told_at_once() {
    let text = CURVE
        .replace("time: rounded", "time: ronuded")
        .replace("norm: abs", "norm: asb")
        .replace("{knob: unit}", "{knob: unti}")
        .replace("[4, 2, 0.5]", "[4, -2, 0.5]");
    let told = plan(&text).err().unwrap().render(false);
    for says in [
        "did you mean `rounded`?",
        "did you mean `abs`?",
        "did you mean `unit`?",
        "-2",
    ] {
        assert!(told.contains(says), "{says} in {told}");
    }
}

/// The files of a folder of the repository with an extension, sorted: stem and text.
fn files(folder: &str, extension: &str) -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder);
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let paths = paths.filter(|path| path.extension().is_some_and(|e| e == extension));
    let stem = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let mut files: Vec<_> = paths
        .map(|path| (stem(&path), std::fs::read_to_string(&path).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn every_shipped_default_is_on_its_front_or_a_decision_says_why() {
    let tables = files("docs/src/curves", "csv");
    assert!(!tables.is_empty());
    for (name, text) in tables {
        let curve = Curve::parse(&text).unwrap_or_else(|e| panic!("{name}.csv, {e}"));
        let better = better_than_default(&curve).unwrap_or_else(|e| panic!("{name}: {e}"));
        if better.is_empty() {
            continue;
        }
        let labels: Vec<_> = better.iter().map(|point| point.label.as_str()).collect();
        let decision = curve.decision.as_deref().unwrap_or("none");
        let decisions = files("docs/decisions", "md");
        let record = decisions
            .iter()
            .find(|(file, _)| file.starts_with(&format!("{decision}-")));
        let says_why = record.is_some_and(|(_, text)| text.contains(&name));
        assert!(
            says_why,
            "{name}: {labels:?} beat the default by more than 10 %, and decision {decision} does not say why"
        );
    }
}

#[test]
fn the_pictures_of_the_book_are_drawn_from_the_tables() {
    let pictures = files("docs/src/curves", "svg");
    for (name, text) in files("docs/src/curves", "csv") {
        let drawn = Curve::parse(&text).unwrap().svg().unwrap();
        let picture = pictures.iter().find(|(file, _)| *file == name);
        assert!(
            picture.is_some_and(|(_, svg)| *svg == drawn),
            "{name}.svg is another; draw it: gear curve docs/src/curves/{name}.csv --out docs/src/curves"
        );
    }
}

#[test]
fn every_shipped_curve_was_measured_and_every_table_is_shown_in_the_book() {
    let tables = files("docs/src/curves", "csv");
    for (name, _) in files("graphs/curves", "yaml") {
        assert!(
            tables.iter().any(|(table, _)| *table == name),
            "@curves/{name} has no table"
        );
    }
    let chapters = files("docs/src", "md");
    let (_, chapter) = chapters.iter().find(|(name, _)| name == "curves").unwrap();
    for (name, _) in tables {
        assert!(chapter.contains(&format!("(curves/{name}.svg)")), "{name} is not shown");
    }
}
