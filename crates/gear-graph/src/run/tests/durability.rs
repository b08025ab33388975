//! Stores that cannot be written, that lose things, that are used by two at once.

use std::sync::Arc;

use super::kit::*;
use crate::*;

const BODY: &str = "inputs: {x: Number}
nodes:
  first: {node: Floor, in: {x: x}}
  measure: {node: Measure, in: {report: first.large}}
  second: {node: Floor, in: {x: measure.length}}
  last: {node: Measure, in: {report: second.large}}
outputs: {length: last.length, large: second.large}";

fn run<'g>(graph: &'g Graph, store: Arc<Store>) -> Run<'g> {
    Run::new(graph).store(store).input_value("x", Number(4.5))
}

#[test]
fn a_store_that_cannot_be_written_changes_no_result_and_is_told_once() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let file = shelf.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let outcome = run(&graph, Arc::new(Store::open(file.join("store")))).go().unwrap();
    assert_eq!(outcome.report.status, RunStatus::Done);
    assert_eq!(outcome.report.warnings.len(), 1, "{:?}", outcome.report.warnings);
    assert_eq!(number(&outcome, "length"), 20_000.0);
}

#[test]
fn a_store_that_breaks_during_the_run_changes_no_result() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let store = shelf.open();
    // Contents can be written no more: a file stands where their folder was.
    std::fs::remove_dir_all(shelf.path().join("contents")).unwrap();
    std::fs::write(shelf.path().join("contents"), "in the way").unwrap();
    let outcome = run(&graph, store).go().unwrap();
    assert_eq!(outcome.report.status, RunStatus::Done);
    assert_eq!(outcome.report.warnings.len(), 1, "{:?}", outcome.report.warnings);
    assert_eq!(number(&outcome, "length"), 20_000.0);
}

#[test]
fn a_store_that_cannot_be_written_still_serves_what_it_has() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    run(&graph, shelf.open()).go().unwrap();
    // As a read-only store behaves, also for root: nothing temporary can be made.
    std::fs::remove_dir_all(shelf.path().join("tmp")).unwrap();
    std::fs::write(shelf.path().join("tmp"), "in the way").unwrap();
    let warm = run(&graph, shelf.open()).go().unwrap();
    assert_eq!(warm.report.ran(), [""; 0]);
    assert_eq!(warm.report.warnings.len(), 1, "{:?}", warm.report.warnings);
    assert!(warm.value("large").is_some());
    let changed = graph_set(BODY, &["last.plus=1"]);
    let outcome = run(&changed, shelf.open()).go().unwrap();
    assert_eq!(number(&outcome, "length"), 20_001.0);
}

#[test]
fn a_full_store_is_collected_at_the_end_of_a_run() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let first = run(&graph, Arc::new(Store::open(shelf.path()).with_limit(30_000)))
        .go()
        .unwrap();
    assert!(shelf.open().stat().content_bytes <= 27_000, "{:?}", shelf.open().stat());
    let warm = run(&graph, shelf.open()).go().unwrap();
    assert_eq!(warm.report.ran(), [""; 0], "digests stay");
    assert_eq!(warm.digest("large"), first.digest("large"));
    assert!(warm.value("large").is_some(), "and values come back");
}

#[test]
fn contents_lost_in_a_chain_are_computed_again_from_the_start() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let first = run(&graph, shelf.open()).go().unwrap();
    shelf.evict_contents();
    let changed = graph_set(BODY, &["last.plus=1"]);
    let outcome = run(&changed, shelf.open()).go().unwrap();
    assert_eq!(
        outcome.report.ran(),
        ["second", "last"],
        "`measure` is small and stands in its record"
    );
    assert_eq!(number(&outcome, "length"), 20_001.0);
    assert_eq!(outcome.digest("large"), first.digest("large"));
}

#[test]
fn what_computes_other_bits_again_fails_and_stores_nothing_wrong() {
    use std::sync::atomic::{AtomicU32, Ordering};
    static RUNS: AtomicU32 = AtomicU32::new(0);

    /// Says that it is deterministic, and is not.
    #[derive(Clone, Debug, Params)]
    struct Liar {}

    impl Node for Liar {
        const NAME: &str = "Liar";
        const VERSION: u32 = 1;
        type Inputs = FloorIn;
        type Outputs = FloorOut;

        fn run(&self, _: FloorIn, want: &Want, _: &Context) -> Result<FloorOut, NodeError> {
            let run = RUNS.fetch_add(1, Ordering::Relaxed);
            Ok(FloorOut {
                whole: want.compute("whole", || Number(0.0)),
                rest: want.compute("rest", || Number(0.0)),
                large: want.compute("large", || Report(serde_json::json!([run, "x".repeat(20_000)]))),
            })
        }
    }

    let mut registry = registry();
    registry.node::<Liar>();
    let text = |plus: u32| {
        format!(
            "gear: 1\ninputs: {{x: Number}}\nnodes: {{liar: {{node: Liar, in: {{x: x}}}}, \
             m: {{node: Measure, in: {{report: liar.large}}, with: {{plus: {plus}}}}}}}\noutputs: {{y: m.length}}"
        )
    };
    let shelf = Shelf::new();
    let go = |plus: u32| {
        let graph = GraphSource::new("test.yaml", text(plus)).check(&registry).unwrap();
        run(&graph, shelf.open()).go().unwrap().report
    };
    assert_eq!(go(0).status, RunStatus::Done);
    shelf.evict_contents();
    let report = go(1);
    assert_eq!(report.status, RunStatus::Failed);
    assert!(
        report.failures[0].chain[0].contains("not deterministic"),
        "{:?}",
        report.failures
    );
    assert_eq!(report.with_status(NodeStatus::Skipped), ["m"]);
}

#[test]
fn two_runs_at_once_share_a_store() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let digests: Vec<_> = std::thread::scope(|scope| {
        let runs: Vec<_> = (0..4)
            .map(|_| scope.spawn(|| run(&graph, shelf.open()).go().unwrap().digest("large")))
            .collect();
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    assert!(digests.iter().all(|digest| digest.is_some() && *digest == digests[0]));
    let warm = run(&graph, shelf.open()).go().unwrap();
    assert_eq!(warm.report.ran(), [""; 0]);
    assert!(warm.report.warnings.is_empty());
}

#[test]
fn whatever_happens_to_the_log_the_result_is_the_same() {
    let (graph, shelf) = (graph(BODY), Shelf::new());
    let clean = run(&graph, shelf.open()).go().unwrap().digest("large");
    let path = shelf.path().join("actions-1.log");
    let whole = std::fs::read(&path).unwrap();
    // Every place would take minutes; a stride that is no multiple of anything visits all kinds of bytes.
    for at in (0..whole.len()).step_by(37) {
        let mut bytes = whole.clone();
        if at % 2 == 0 {
            bytes.truncate(at);
        } else {
            bytes[at] ^= 0x5a;
        }
        std::fs::write(&path, &bytes).unwrap();
        let outcome = run(&graph, shelf.open()).jobs(1).go().unwrap();
        assert_eq!(outcome.digest("large"), clean, "byte {at}");
        assert_eq!(number(&outcome, "length"), 20_000.0);
    }
}
