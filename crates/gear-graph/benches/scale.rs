//! What the framework itself costs: graphs of nodes that do nothing, in a chain and side by side.
//!
//! `cargo bench -p gear-graph` prints wall and CPU seconds of reading and checking the file, of a cold run, of a warm
//! run, and of a run after the last node's parameter changed, each with the real store on disk.

use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

use gear_graph::{
    Context, GraphSource, Inputs, Node, NodeError, Number, Outputs, Params, Registry, Run, Store, Want, peak_memory,
};

/// Adds up.
#[derive(Clone, Debug, Params)]
struct Add {
    /// Added to the sum.
    #[param(default = 0.0)]
    plus: f64,
}

#[derive(Inputs)]
struct In {
    /// The numbers.
    of: Vec<Arc<Number>>,
}

#[derive(Outputs)]
struct Out {
    /// The sum.
    sum: Arc<Number>,
}

impl Node for Add {
    const NAME: &str = "Add";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _: &Want, _: &Context) -> Result<Out, NodeError> {
        let sum = inputs.of.iter().fold(self.plus, |sum, x| sum + x.0);
        Ok(Out {
            sum: Arc::new(Number(sum)),
        })
    }
}

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
    for i in 0..nodes - 1 {
        let _ = writeln!(text, "  n{i}: {{node: Add, in: {{of: x}}, with: {{plus: {i}}}}}");
        all.push(format!("n{i}.sum"));
    }
    let _ = writeln!(
        text,
        "  n{}: {{node: Add, in: {{of: [{}]}}}}",
        nodes - 1,
        all.join(", ")
    );
    let _ = writeln!(text, "outputs: {{y: n{}.sum}}", nodes - 1);
    text
}

/// CPU seconds of the process so far, all threads; from /proc, in hundredths.
fn cpu() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks: f64 = after
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|n| n.parse::<f64>().ok())
        .fold(0.0, |sum, n| sum + n);
    ticks / 100.0
}

fn main() {
    let mut registry = Registry::new();
    registry.node::<Add>();
    println!(
        "{:>8} {:>7} | {:>16} {:>16} {:>16} {:>16}",
        "graph", "nodes", "check", "cold", "warm", "leaf changed"
    );
    for nodes in [1_000, 10_000, 100_000] {
        for (name, text) in [("chain", chain(nodes)), ("wide", wide(nodes))] {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let mut cells = Vec::new();
            let timed = |cells: &mut Vec<String>, work: &mut dyn FnMut()| {
                let (wall, cpu_before) = (Instant::now(), cpu());
                work();
                cells.push(format!(
                    "{:.3} ({:.2} cpu)",
                    wall.elapsed().as_secs_f64(),
                    cpu() - cpu_before
                ));
            };
            let mut graph = None;
            timed(&mut cells, &mut || {
                graph = GraphSource::new("bench.yaml", &*text).check(&registry).ok()
            });
            let graph = graph.expect("a good graph");
            let leaf = GraphSource::new("bench.yaml", &*text).set(format!("n{}.plus=7", nodes - 1));
            let changed = leaf.check(&registry).expect("a good graph");
            for graph in [&graph, &graph, &changed] {
                timed(&mut cells, &mut || {
                    let store = Arc::new(Store::open(folder.path()));
                    let run = Run::new(graph).store(store).input_value("x", Number(0.0));
                    drop(run.go().expect("a good run"));
                });
            }
            println!(
                "{name:>8} {nodes:>7} | {:>16} {:>16} {:>16} {:>16}",
                cells[0], cells[1], cells[2], cells[3]
            );
        }
    }
    println!("peak memory: {} MB", peak_memory().unwrap_or(0) / 1_000_000);
}
