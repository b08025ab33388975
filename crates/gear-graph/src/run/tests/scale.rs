//! Long chains and wide graphs: nothing recurses, nothing is quadratic.

use std::fmt::Write;
use std::time::Instant;

use super::kit::*;
use crate::*;

fn chain(nodes: usize) -> String {
    let mut text = String::from("gear: 1\ninputs: {x: Number}\nnodes:\n  n0: {node: Add, in: {of: x}}\n");
    for i in 1..nodes {
        let _ = writeln!(
            text,
            "  n{i}: {{node: Add, in: {{of: n{}.sum}}, with: {{plus: 1}}}}",
            i - 1
        );
    }
    let _ = writeln!(text, "outputs: {{y: n{}.sum}}", nodes - 1);
    text
}

fn wide(nodes: usize) -> String {
    let mut text = String::from("gear: 1\ninputs: {x: Number}\nnodes:\n");
    let mut all = Vec::new();
    for i in 0..nodes {
        let _ = writeln!(text, "  n{i}: {{node: Add, in: {{of: x}}, with: {{plus: {i}}}}}");
        all.push(format!("n{i}.sum"));
    }
    let _ = writeln!(text, "  end: {{node: Add, in: {{of: [{}]}}}}", all.join(", "));
    text.push_str("outputs: {y: end.sum}\n");
    text
}

fn check(text: &str) -> Graph {
    GraphSource::new("big.yaml", text).check(&registry()).unwrap()
}

#[test]
fn twenty_thousand_nodes_in_a_chain_and_side_by_side() {
    const N: usize = 20_000;
    for (name, text, expected) in [
        ("chain", chain(N), (N - 1) as f64),
        ("wide", wide(N), (N * (N - 1) / 2) as f64),
    ] {
        let shelf = Shelf::new();
        let started = Instant::now();
        let graph = check(&text);
        let checked = started.elapsed();
        let run = || Run::new(&graph).store(shelf.open()).input_value("x", Number(0.0));
        let cold = run().go().unwrap();
        assert_eq!(number(&cold, "y"), expected);
        let cold_time = started.elapsed() - checked;
        let warm_started = Instant::now();
        let warm = run().go().unwrap();
        assert_eq!(warm.digest("y"), cold.digest("y"));
        assert!(warm.report.ran().is_empty());
        println!(
            "{name}: check {checked:?}, cold {cold_time:?}, warm {:?}",
            warm_started.elapsed()
        );
        let plan = run().plan().unwrap();
        assert!(plan.nodes.iter().all(|node| node.state != PlannedState::Runs));
        let cold_plan = Run::new(&graph).input_value("x", Number(1.0)).plan().unwrap();
        let runs = cold_plan.nodes.iter().filter(|node| node.state == PlannedState::Runs);
        assert_eq!(runs.count(), graph.nodes().len());
    }
}

#[test]
fn a_failure_at_the_head_of_a_long_chain_skips_it_without_recursion() {
    let text = chain(20_000).replace(
        "n0: {node: Add, in: {of: x}}",
        "t: {node: Trouble, in: {x: x}}\n  n0: {node: Add, in: {of: t.never}}",
    );
    let graph = check(&text);
    let outcome = Run::new(&graph).input_value("x", Number(0.0)).go().unwrap();
    assert_eq!(outcome.report.with_status(NodeStatus::Skipped).len(), 20_000);
}

#[test]
fn a_long_chain_that_is_not_needed_dies_without_recursion() {
    let text = chain(20_000).replace(
        "outputs: {y: n19999.sum}",
        "  c: {node: Choose, in: {a: x, b: n19999.sum}, with: {when: never}}\noutputs: {y: c.chosen}",
    );
    let graph = check(&text);
    let outcome = Run::new(&graph).input_value("x", Number(0.0)).go().unwrap();
    assert_eq!(outcome.report.ran(), ["c"]);
    assert_eq!(outcome.report.with_status(NodeStatus::LeftOut).len(), 20_000);
}

#[test]
fn a_long_loop_is_shown_without_recursion() {
    let text = chain(20_000).replace("n0: {node: Add, in: {of: x}}", "n0: {node: Add, in: {of: n19999.sum}}");
    let mistakes = GraphSource::new("big.yaml", text).check(&registry()).unwrap_err();
    assert!(mistakes.problems().iter().any(|problem| problem.code == "cycle"));
}

#[test]
fn values_are_dropped_when_their_last_reader_is_done() {
    // 200 reports of 40 MB in a chain would be 8 GB.
    /// Hands a large report on.
    #[derive(Clone, Debug, Params)]
    struct Heavy {}

    #[derive(Inputs)]
    struct HeavyIn {
        /// Any.
        report: std::sync::Arc<Report>,
    }

    #[derive(Outputs)]
    struct HeavyOut {
        /// As large, and another.
        report: std::sync::Arc<Report>,
    }

    impl Node for Heavy {
        const NAME: &str = "Heavy";
        const VERSION: u32 = 1;
        type Inputs = HeavyIn;
        type Outputs = HeavyOut;

        fn run(&self, inputs: HeavyIn, _: &Want, _: &Context) -> Result<HeavyOut, NodeError> {
            let step = inputs.report.0["step"].as_u64().unwrap_or(0) + 1;
            let report = Report(serde_json::json!({ "step": step, "filling": "x".repeat(2_000_000) }));
            Ok(HeavyOut {
                report: std::sync::Arc::new(report),
            })
        }
    }

    let mut registry = registry();
    registry.node::<Heavy>();
    let mut text = String::from("gear: 1\ninputs: {x: Report}\nnodes:\n  n0: {node: Heavy, in: {report: x}}\n");
    for i in 1..200 {
        let _ = writeln!(text, "  n{i}: {{node: Heavy, in: {{report: n{}.report}}}}", i - 1);
    }
    text.push_str("outputs: {y: n199.report}\n");
    let graph = GraphSource::new("heavy.yaml", text).check(&registry).unwrap();
    let report = Report(serde_json::Value::Null);
    let outcome = Run::new(&graph).input_value("x", report).go().unwrap();
    let last = outcome.value("y").unwrap().get::<Report>().unwrap();
    assert_eq!(last.0["step"], 200);
    let peak = outcome.report.node("n199").unwrap().peak_memory;
    assert!(peak < 300 << 20, "{peak} bytes held after 400 MB went through");
}
