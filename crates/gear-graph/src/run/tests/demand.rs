//! Demand, plans and realms.

use std::sync::Arc;

use super::kit::*;
use crate::*;

const CHOOSE: &str = "inputs: {a: Number, b: Number, c: {type: Number, optional: true}}
nodes:
  left: {node: Add, in: {of: a}}
  far: {node: Add, in: {of: b}, with: {plus: 1}}
  right: {node: Add, in: {of: far.sum}}
  choose: {node: Choose, in: {a: left.sum, b: right.sum, c: c}}
outputs: {chosen: choose.chosen}";

fn with<'g>(graph: &'g Graph, a: f64, b: f64) -> Run<'g> {
    Run::new(graph).input_value("a", Number(a)).input_value("b", Number(b))
}

#[test]
fn a_branch_that_a_parameter_makes_dead_never_starts() {
    let graph = graph_set(CHOOSE, &["choose.when=never"]);
    let outcome = with(&graph, 99.0, 5.0).go().unwrap();
    assert_eq!(outcome.report.ran(), ["left", "choose"]);
    assert_eq!(outcome.report.with_status(NodeStatus::LeftOut), ["far", "right"]);
    let reason = |id: &str| outcome.report.node(id).unwrap().reason.clone().unwrap();
    assert_eq!(reason("right"), "`choose` does without `b`: never");
    assert_eq!(reason("far"), "only `right` would read it, which is left out");
}

#[test]
fn a_branch_that_the_values_make_dead_never_starts() {
    let graph = graph(CHOOSE);
    assert_eq!(with(&graph, 1.0, 5.0).go().unwrap().report.ran(), ["left", "choose"]);
    assert_eq!(
        with(&graph, 11.0, 5.0).go().unwrap().report.ran(),
        ["left", "far", "right", "choose"]
    );
}

#[test]
fn demand_may_go_on_asking_after_it_saw_what_it_asked_for() {
    let graph = graph(CHOOSE);
    let run = |b: f64| with(&graph, 11.0, b).input_value("c", Number(77.0)).go().unwrap();
    assert_eq!(number(&run(5.0), "chosen"), 6.0);
    assert_eq!(number(&run(-5.0), "chosen"), 77.0);
    assert_eq!(
        number(&with(&graph, 11.0, -5.0).go().unwrap(), "chosen"),
        -4.0,
        "c is optional"
    );
}

#[test]
fn only_the_outputs_that_are_asked_for_are_computed() {
    let body = CHOOSE.replace("chosen: choose.chosen", "chosen: choose.chosen, far: far.sum");
    let graph = graph(&body);
    let outcome = with(&graph, 1.0, 5.0).outputs(["far"]).go().unwrap();
    assert_eq!(outcome.report.ran(), ["far"]);
    assert!(outcome.digest("chosen").is_none() && outcome.value("chosen").is_none());
    assert_eq!(number(&outcome, "far"), 6.0);
}

#[test]
fn the_plan_of_a_cold_run_says_what_runs_and_what_may() {
    let (graph, shelf) = (graph(CHOOSE), Shelf::new());
    let plan = with(&graph, 1.0, 5.0).store(shelf.open()).plan().unwrap();
    let text: Vec<_> = plan
        .nodes
        .iter()
        .map(|n| format!("{}: {:?}, {}", n.id, n.state, n.reason))
        .collect();
    insta::assert_debug_snapshot!("plan_cold", text);
    assert!(shelf.open().stat().actions == 0, "a plan stores nothing");
}

#[test]
fn the_plan_of_a_warm_run_says_what_is_cached_and_what_is_left_out() {
    let (graph, shelf) = (graph(CHOOSE), Shelf::new());
    let run = || with(&graph, 1.0, 5.0).store(shelf.open());
    run().go().unwrap();
    let plan = run().plan().unwrap();
    let text: Vec<_> = plan
        .nodes
        .iter()
        .map(|n| format!("{}: {:?}, {}", n.id, n.state, n.reason))
        .collect();
    insta::assert_debug_snapshot!("plan_warm", text);
    assert_eq!(
        plan.node("choose").unwrap().elided[0].reason,
        "a is not above the threshold"
    );
    // A new parameter of the last node: only that runs.
    let changed = graph_set(CHOOSE, &["choose.when.above.threshold=0.5"]);
    let plan = with(&changed, 1.0, 5.0).store(shelf.open()).plan().unwrap();
    let state = |id: &str| plan.node(id).unwrap().state;
    assert_eq!(
        (state("left"), state("choose")),
        (PlannedState::Cached, PlannedState::Runs)
    );
    assert_eq!(state("right"), PlannedState::MayRun);
}

#[test]
fn fresh_runs_one_node_whatever_is_stored() {
    let (graph, shelf) = (graph(CHOOSE), Shelf::new());
    let run = || with(&graph, 1.0, 5.0).store(shelf.open());
    run().go().unwrap();
    let outcome = run().fresh("left").go().unwrap();
    assert_eq!(outcome.report.ran(), ["left"], "what follows sees the same digest");
    assert_eq!(
        run().fresh("left").plan().unwrap().node("left").unwrap().state,
        PlannedState::Runs
    );
}

#[test]
fn what_is_not_deterministic_is_never_cached() {
    let body = "nodes: {dice: {node: Dice}, add: {node: Add, in: {of: dice.sum}}}\noutputs: {sum: add.sum}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let run = || Run::new(&graph).store(shelf.open()).go().unwrap();
    let (first, second) = (run(), run());
    assert_eq!(first.report.ran(), ["dice", "add"]);
    assert_eq!(second.report.ran(), ["dice", "add"]);
    assert_ne!(first.digest("sum"), second.digest("sum"));
}

/// Another answer each time, each worth keeping.
#[derive(Clone, Debug, Params)]
struct Oracle {}

impl Node for Oracle {
    const NAME: &str = "Oracle";
    const VERSION: u32 = 1;
    const DETERMINISTIC: bool = false;
    const KEPT: bool = true;
    type Inputs = FloorIn;
    type Outputs = AddOut;

    fn run(&self, inputs: FloorIn, _: &Want, _: &Context) -> Result<AddOut, NodeError> {
        use std::sync::atomic::{AtomicU32, Ordering};
        static ASKED: AtomicU32 = AtomicU32::new(0);
        Ok(AddOut {
            sum: Arc::new(Number(inputs.x.0 + f64::from(ASKED.fetch_add(1, Ordering::Relaxed)))),
        })
    }
}

#[test]
fn an_answer_stands_until_it_is_asked_for_afresh() {
    let mut registry = Registry::new();
    registry.value::<Number>().node::<Oracle>();
    let body = "gear: 1\ninputs: {x: Number}\nnodes: {n: {node: Oracle, in: {x: x}}}\noutputs: {y: n.sum}\n";
    let (graph, shelf) = (
        GraphSource::new("oracle.yaml", body).check(&registry).unwrap(),
        Shelf::new(),
    );
    let run = || Run::new(&graph).input_value("x", Number(0.0)).store(shelf.open());
    let answer = |run: Run<'_>| number(&run.go().unwrap(), "y");
    let first = answer(run());
    assert_eq!(answer(run()), first);
    let second = answer(run().fresh("n"));
    assert_ne!(second, first);
    assert_eq!(answer(run()), second);
    assert!(!run().go().unwrap().report.node("n").unwrap().deterministic);
}

#[test]
fn a_cpu_result_serves_another_realm_and_never_the_reverse() {
    macro_rules! double {
        ($name:ident, $realm:literal) => {
            /// Doubles, somewhere.
            #[derive(Clone, Debug, Params)]
            struct $name {}

            impl Node for $name {
                const NAME: &str = "Double";
                const VERSION: u32 = 1;
                type Inputs = FloorIn;
                type Outputs = AddOut;

                fn realm(&self, _: &Resources) -> String {
                    $realm.into()
                }

                fn run(&self, inputs: FloorIn, _: &Want, _: &Context) -> Result<AddOut, NodeError> {
                    let sum = std::sync::Arc::new(Number(2.0 * inputs.x.0));
                    Ok(AddOut { sum })
                }
            }
        };
    }
    double!(Cpu, "cpu");
    double!(Gpu, "gpu:test:1");

    fn check<N: Node>() -> Graph {
        let mut registry = registry();
        registry.node::<N>();
        let text = "gear: 1\ninputs: {x: Number}\nnodes: {d: {node: Double, in: {x: x}}}\noutputs: {y: d.sum}";
        GraphSource::new("test.yaml", text).check(&registry).unwrap()
    }

    let (cpu, gpu) = (check::<Cpu>(), check::<Gpu>());
    let ran = |graph: &Graph, shelf: &Shelf| {
        let run = Run::new(graph).store(shelf.open()).input_value("x", Number(1.0));
        !run.go().unwrap().report.ran().is_empty()
    };
    let shelf = Shelf::new();
    assert!(ran(&cpu, &shelf) && !ran(&gpu, &shelf), "cpu serves gpu");
    let shelf = Shelf::new();
    assert!(
        ran(&gpu, &shelf) && ran(&cpu, &shelf) && !ran(&gpu, &shelf),
        "gpu serves gpu only"
    );
}

#[test]
fn mistakes_in_asking_are_reported_together() {
    let graph = graph(CHOOSE);
    let mistakes = Run::new(&graph)
        .input_value("aa", Number(1.0))
        .input_value("b", Report(serde_json::Value::Null))
        .outputs(["chose"])
        .fresh("chosse")
        .go()
        .unwrap_err();
    let text: Vec<_> = mistakes.iter().map(ToString::to_string).collect();
    insta::assert_debug_snapshot!("run_mistakes", text);
}

#[test]
fn notes_are_told_again_when_the_result_comes_from_the_store() {
    let body = "inputs: {x: Number}\nnodes: {floor: {node: Floor, in: {x: x}}}\noutputs: {whole: floor.whole}";
    let (graph, shelf) = (graph(body), Shelf::new());
    for _ in 0..2 {
        let run = Run::new(&graph).store(shelf.open()).input_value("x", Number(-1.5));
        let report = run.go().unwrap().report;
        assert_eq!(
            report.node("floor").unwrap().notes,
            ["negative numbers round away from zero"]
        );
    }
}

#[test]
fn values_that_are_asked_for_come_back_although_the_store_lost_them() {
    let body = "inputs: {x: Number}
nodes: {floor: {node: Floor, in: {x: x}}}
outputs: {large: floor.large, x: x}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let run = || Run::new(&graph).store(shelf.open()).input_value("x", Number(2.5));
    run().go().unwrap();
    shelf.evict_contents();
    assert!(run().go().unwrap().report.ran().is_empty(), "digests are enough");
    let outcome = run().with_values().go().unwrap();
    assert_eq!(
        (outcome.report.status, outcome.report.ran()),
        (RunStatus::Done, vec!["floor"])
    );
    assert_eq!(number(&outcome, "x"), 2.5);
    // Nothing is left half done, also for the input that was given as a value.
    let unfinished = outcome.report.with_status(NodeStatus::Unfinished);
    assert!(unfinished.is_empty(), "{unfinished:?}");
    assert!(outcome.report.outputs.iter().all(|output| output.digest.is_some()));
}

/// Only what somebody needs a value for runs again, and the plan, the record and the run say the same of it.
#[test]
fn a_lost_value_is_computed_in_the_first_run_for_who_has_nothing_made_of_it() {
    let body = "inputs: {x: Number}
nodes:
  floor: {node: Floor, in: {x: x}}
  more: {node: Add, in: {of: x}, with: {plus: 1}}
  other: {node: Floor, in: {x: more.sum}}
outputs: {large: floor.large, other: other.large}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let run = || Run::new(&graph).store(shelf.open()).input_value("x", Number(2.5));
    let first = run().go().unwrap().report;
    shelf.evict_contents();
    let digests: std::collections::BTreeMap<_, _> = first
        .outputs
        .iter()
        .map(|output| (output.name.clone(), output.digest.clone().unwrap()))
        .collect();
    let run = run().with_values_where(move |output, digest| {
        assert_eq!(digests[output], digest.hex());
        output == "large"
    });
    let planned = run.plan().unwrap();
    let state = |id: &str| planned.node(id).unwrap().state;
    assert_eq!(
        (state("floor"), state("other")),
        (PlannedState::Runs, PlannedState::Cached)
    );
    let mut outcome = run.go().unwrap();
    assert_eq!(outcome.report.ran(), ["floor"]);
    assert!(outcome.recover("large").is_some());
    assert_eq!(outcome.report.ran(), ["floor"], "nothing had to be computed again");
    // Whoever finds too late that he needs a value gets it, and the record says what ran for it.
    assert!(outcome.recover("other").is_some());
    assert_eq!(outcome.report.ran(), ["floor", "other"]);
    assert!(outcome.recover("none").is_none());
}

#[test]
fn an_optional_input_that_is_not_given_is_told_apart() {
    let body = "inputs: {a: Number, c: {type: Number, optional: true}}
nodes:
  sum: {node: Add, in: {of: [a, c]}}
outputs: {y: sum.sum}";
    let graph = graph(body);
    let run = Run::new(&graph).input_value("a", Number(1.0));
    let state = |id: &str| run.plan().unwrap().node(id).unwrap().state;
    assert_eq!((state("a"), state("c")), (PlannedState::Given, PlannedState::NotGiven));
    let report = run.go().unwrap().report;
    let node = |id: &str| report.nodes.iter().find(|node| node.id == id).unwrap();
    assert_eq!(node("a").status, NodeStatus::Given);
    assert_eq!(node("c").status, NodeStatus::NotGiven);
}

#[test]
fn an_input_that_nothing_needs_need_not_be_given() {
    let body = "inputs: {a: Number, b: Number, extra: Number}
nodes:
  sum: {node: Add, in: {of: [a]}}
  other: {node: Add, in: {of: [a, b]}}
outputs: {y: sum.sum, z: other.sum}";
    let graph = graph(body);
    let run = || Run::new(&graph).input_value("a", Number(1.0));
    let asked = run().outputs(["y"]);
    let plan = asked.plan().unwrap();
    assert_eq!(plan.node("extra").unwrap().state, PlannedState::LeftOut);
    assert!(asked.why("extra").is_ok() && asked.why("other").is_ok());
    let report = asked.go().unwrap().report;
    assert_eq!(report.status, RunStatus::Done);
    let node = |id: &str| report.nodes.iter().find(|node| node.id == id).unwrap();
    assert_eq!(
        (node("b").status, node("extra").status),
        (NodeStatus::LeftOut, NodeStatus::LeftOut)
    );
    // What an output needs is still asked for, and only that.
    let missing: Vec<_> = run().go().err().unwrap().iter().map(ToString::to_string).collect();
    assert!(
        missing.len() == 1 && missing[0].contains("the input `b`"),
        "{missing:?}"
    );
}
