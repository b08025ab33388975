//! Curves of a small graph.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use gear_graph::{Library, Run, Store};

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
        cancel: Arc::new(AtomicBool::new(false)),
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
