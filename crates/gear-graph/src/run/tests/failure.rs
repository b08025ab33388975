//! Failures, panics, interruptions.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::kit::*;
use crate::*;

const BODY: &str = "inputs: {x: Number}
nodes:
  good: {node: Add, in: {of: x}}
  bad: {node: Trouble, in: {x: good.sum}}
  after: {node: Add, in: {of: bad.never}}
  later: {node: Add, in: {of: [after.sum, good.sum]}}
  other: {node: Floor, in: {x: good.sum}}
outputs: {later: later.sum, other: other.large}";

fn run<'g>(graph: &'g Graph, shelf: &Shelf) -> Run<'g> {
    Run::new(graph).store(shelf.open()).input_value("x", Number(4.5))
}

#[test]
fn a_failure_is_told_with_its_causes_and_inputs_and_the_rest_is_finished_and_stored() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let outcome = run(&graph, &shelf).go().unwrap();
    let report = &outcome.report;
    assert_eq!(report.status, RunStatus::Failed);
    assert_eq!(report.ran(), ["good", "other"]);
    assert_eq!(report.with_status(NodeStatus::Failed), ["bad"]);
    assert_eq!(report.with_status(NodeStatus::Skipped), ["after", "later"]);
    assert_eq!(report.node("later").unwrap().reason.as_deref(), Some("`bad` failed"));
    insta::assert_snapshot!("failure", report.failures[0].to_string());
    assert!(outcome.value("other").is_some() && outcome.value("later").is_none());
    let again = run(&graph, &shelf).go().unwrap();
    assert_eq!(again.report.with_status(NodeStatus::Cached), ["good", "other"]);
    assert_eq!(again.report.failures.len(), 1, "a failure is not stored");
}

#[test]
fn a_panic_is_a_failure_of_its_node_only() {
    for (kind, message) in [("panic", "the node is broken"), ("forget", "did not compute")] {
        let (graph, shelf) = (graph_set(BODY, &[&format!("bad.kind={kind}")]), Shelf::new());
        let outcome = run(&graph, &shelf).go().unwrap();
        assert_eq!(outcome.report.ran(), ["good", "other"]);
        let failure = &outcome.report.failures[0];
        assert!(failure.chain[0].contains(message), "{failure}");
        assert_eq!(failure.kind == FailureKind::Panic, kind == "panic");
    }
}

#[test]
fn fail_fast_starts_nothing_more() {
    let body = "inputs: {x: Number}
nodes:
  bad: {node: Trouble, in: {x: x}}
  a: {node: Add, in: {of: x}}
  b: {node: Add, in: {of: a.sum}, with: {plus: 1}}
outputs: {never: bad.never, b: b.sum}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let outcome = run(&graph, &shelf).jobs(1).fail_fast().go().unwrap();
    assert!(outcome.report.ran().len() < 2, "{:?}", outcome.report.ran());
    assert_eq!(
        run(&graph, &shelf)
            .jobs(1)
            .go()
            .unwrap()
            .report
            .with_status(NodeStatus::Failed),
        ["bad"]
    );
}

#[test]
fn an_interruption_stops_within_a_second_and_what_was_done_is_stored() {
    // One that wakes the run, and a bare flag, at which the run looks now and then.
    let bare = || Cancel::from(Arc::new(AtomicBool::new(false)));
    for (kind, cancel) in [("wait", Cancel::new()), ("deaf", Cancel::new()), ("wait", bare())] {
        let (graph, shelf) = (graph_set(BODY, &[&format!("bad.kind={kind}")]), Shelf::new());
        let (raise, seen) = (cancel.clone(), Arc::new(Mutex::new(None)));
        let when = Arc::clone(&seen);
        // Raised from elsewhere, once the endless node runs, the other branch is done, and the run has gone to sleep.
        let observer = move |event: &Event<'_>| {
            if let Event::Ran { node: "other", .. } = event {
                let (raise, when) = (raise.clone(), Arc::clone(&when));
                std::thread::spawn(move || {
                    std::thread::sleep(Duration::from_millis(300));
                    *when.lock().unwrap() = Some(Instant::now());
                    raise.raise();
                });
            }
        };
        let outcome = run(&graph, &shelf)
            .jobs(2)
            .cancel(cancel)
            .observer(Arc::new(observer))
            .go()
            .unwrap();
        let took = seen.lock().unwrap().unwrap().elapsed();
        assert!(took < Duration::from_secs(1), "{kind}: {took:?}");
        assert_eq!(outcome.report.status, RunStatus::Interrupted);
        assert!(outcome.report.failures.is_empty());
        assert_eq!(
            outcome.report.with_status(NodeStatus::Unfinished),
            ["bad", "after", "later"]
        );
        drop(outcome);
        let next = graph_set(BODY, &["bad.kind=error"]);
        let resumed = run(&next, &shelf).go().unwrap();
        assert_eq!(
            resumed.report.with_status(NodeStatus::Cached),
            ["good", "other"],
            "{kind}"
        );
    }
}

#[test]
fn an_interruption_ends_the_reading_of_inputs() {
    let graph = graph("inputs: {x: Number}\noutputs: {y: x}\n");
    let shelf = tempfile::tempdir().unwrap();
    let path = shelf.path().join("x.txt");
    std::fs::write(&path, "1").unwrap();
    let run = Run::new(&graph).input("x", Input::file(path));
    assert!(run.go().is_ok());
    let cancel = Cancel::new();
    cancel.raise();
    let mistakes = run.cancel(cancel).go().unwrap_err();
    assert_eq!(mistakes, [RunMistake::Interrupted]);
}

#[test]
fn a_file_that_cannot_be_used_is_told_with_its_name() {
    let body = "inputs: {x: Number, y: Number}\nnodes: {add: {node: Add, in: {of: [x, y]}}}\noutputs: {sum: add.sum}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let path = |name: &str, text: &str| {
        let path = shelf.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let outcome = Run::new(&graph)
        .input("x", Input::file(path("good.txt", "1")))
        .input("y", Input::file(path("bad.txt", "one")))
        .go()
        .unwrap();
    let failure = &outcome.report.failures[0];
    assert_eq!(failure.kind, FailureKind::Load);
    assert!(
        failure.to_string().contains("bad.txt: expected a number, found `one`"),
        "{failure}"
    );
    assert_eq!(outcome.report.with_status(NodeStatus::Skipped), ["add"]);

    let missing = Run::new(&graph)
        .input("x", Input::file(shelf.path().join("not-there.txt")))
        .input("y", Input::file(path("empty.txt", "")))
        .go()
        .unwrap_err();
    let text: Vec<_> = missing.iter().map(ToString::to_string).collect();
    assert!(text[0].ends_with("not-there.txt: there is no such file"), "{text:?}");
    assert!(text[1].ends_with("empty.txt: the file is empty"), "{text:?}");
}

#[test]
fn an_observer_hears_what_happens_in_order() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let heard = Arc::new(Mutex::new(Vec::new()));
    let sink = Arc::clone(&heard);
    let observer = move |event: &Event<'_>| {
        let line = match event {
            Event::Running { node, outputs, .. } => format!("running {node} {outputs:?}"),
            Event::Ran { node, .. } => format!("ran {node}"),
            Event::Failed { failure } => format!("failed {}", failure.node),
            Event::Skipped { node, because_of } => format!("skipped {node} because of {because_of}"),
            Event::Hit { node, output, .. } => format!("hit {node}.{output}"),
            _ => return,
        };
        sink.lock().unwrap().push(line);
    };
    run(&graph, &shelf).jobs(1).observer(Arc::new(observer)).go().unwrap();
    insta::assert_debug_snapshot!("heard", *heard.lock().unwrap());
}
