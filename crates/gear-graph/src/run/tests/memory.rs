//! What a memory limit promises.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::kit::*;
use crate::*;

/// Bytes of a `Block`.
const MIB: u64 = 1 << 20;

static AT_WORK: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);
/// The counters are of the process: one test at a time.
static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());

/// Claims to need some mebibytes, and counts how many of its kind are at work.
#[derive(Clone, Debug, Params)]
struct Claim {
    /// What it claims.
    #[param(default = 10)]
    mib: u32,
    /// Tells one from another.
    #[param(default = 0)]
    number: u32,
}

impl Node for Claim {
    const NAME: &str = "Claim";
    const VERSION: u32 = 1;
    type Inputs = AddIn;
    type Outputs = AddOut;

    fn memory(&self, inputs: &[u64]) -> Option<u64> {
        Some(u64::from(self.mib) * MIB + inputs[0])
    }

    fn run(&self, inputs: AddIn, _: &Want, _: &Context) -> Result<AddOut, NodeError> {
        let now = AT_WORK.fetch_add(1, Ordering::SeqCst) + 1;
        MOST.fetch_max(now, Ordering::SeqCst);
        std::thread::sleep(std::time::Duration::from_millis(20));
        AT_WORK.fetch_sub(1, Ordering::SeqCst);
        let sum = inputs.of.iter().fold(f64::from(self.number), |sum, x| sum + x.0);
        Ok(AddOut {
            sum: Arc::new(Number(sum)),
        })
    }
}

/// Eight claims side by side, and their sum.
fn side_by_side() -> Graph {
    let mut registry = registry();
    registry.node::<Claim>();
    let mut text = String::from("gear: 1\ninputs: {x: Number}\nnodes:\n");
    for i in 0..8 {
        text += &format!("  n{i}: {{node: Claim, in: {{of: x}}, with: {{number: {i}}}}}\n");
    }
    let all: Vec<_> = (0..8).map(|i| format!("n{i}.sum")).collect();
    text += &format!(
        "  all: {{node: Add, in: {{of: [{}]}}}}\noutputs: {{y: all.sum}}\n",
        all.join(", ")
    );
    GraphSource::new("claims.yaml", text).check(&registry).unwrap()
}

/// How many claims were at work at once, and the report.
fn run(limit: Option<u64>) -> (usize, RunReport) {
    let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    MOST.store(0, Ordering::SeqCst);
    let graph = side_by_side();
    let mut run = Run::new(&graph).jobs(8).input_value("x", Number(1.0));
    if let Some(limit) = limit {
        run = run.memory_limit(limit);
    }
    let outcome = run.go().unwrap();
    assert_eq!(number(&outcome, "y"), 36.0);
    (MOST.load(Ordering::SeqCst), outcome.report)
}

#[test]
fn nodes_are_held_back_so_that_the_estimate_stays_under_the_limit() {
    let (most, report) = run(None);
    assert!(most > 3, "{most} of 8 at once without a limit");
    assert_eq!(report.memory.held_back, 0);
    let (most, report) = run(Some(35 * MIB));
    assert!((1..=3).contains(&most), "{most} at once, each 10 MiB, below 35 MiB");
    assert!(report.memory.held_back > 0);
    assert!(report.memory.estimated_peak <= 35 * MIB, "{:?}", report.memory);
    assert!(report.nodes.iter().all(|node| node.notes.is_empty()));
}

#[test]
fn what_does_not_fit_at_all_runs_alone_and_says_so() {
    let (most, report) = run(Some(MIB));
    assert_eq!(most, 1);
    assert_eq!(report.status, RunStatus::Done);
    let note = &report.node("n3").unwrap().notes[0];
    assert!(note.contains("11 MiB") || note.contains("10 MiB"), "{note}");
    assert!(note.contains("above the limit of 1 MiB"), "{note}");
}

#[test]
fn values_from_the_store_are_held_back_too() {
    let body = "inputs: {x: Number}
nodes:
  a: {node: Floor, in: {x: x}}
  m0: {node: Measure, in: {report: a.large}}
  b: {node: Floor, in: {x: m0.length}}
  m1: {node: Measure, in: {report: b.large}}
outputs: {m0: m0.length, m1: m1.length}";
    let shelf = Shelf::new();
    let first = graph(body);
    let run = |graph: &Graph, limit: u64| {
        let run = Run::new(graph).store(shelf.open()).input_value("x", Number(2.5));
        let outcome = run.jobs(4).memory_limit(limit).go().unwrap();
        (number(&outcome, "m0"), number(&outcome, "m1"), outcome.report.memory)
    };
    assert_eq!(run(&first, 1 << 30).1, 20_000.0);
    // Both measures must run and need a value from the store each; one fits.
    let changed = graph_set(body, &["m0.plus=1", "m1.plus=1"]);
    let (m0, m1, memory) = run(&changed, 50_000);
    assert_eq!((m0, m1), (20_001.0, 20_001.0));
    assert!(memory.estimated_peak > 0);
}

#[test]
fn what_is_not_deterministic_is_cached_when_asked_for() {
    let (graph, shelf) = (graph("nodes: {d: {node: Dice}}\noutputs: {y: d.sum}"), Shelf::new());
    let run = || Run::new(&graph).store(shelf.open());
    let first = number(&run().cache_nondeterministic().go().unwrap(), "y");
    assert_eq!(number(&run().cache_nondeterministic().go().unwrap(), "y"), first);
    let report = run().go().unwrap().report;
    assert_eq!(report.ran(), ["d"], "what another run kept is not used unasked");
    assert!(!report.node("d").unwrap().deterministic);
    assert!(!run().plan().unwrap().node("d").unwrap().deterministic);
}
