//! What the framework itself costs: graphs of nodes that do nothing, in a chain and side by side.
//!
//! `cargo bench -p gear-graph --bench scale` prints a table of CPU seconds, and of the memory of the largest graphs.
//! Every figure is one whole process of its own, from the YAML file to the outputs, with the real store on disk; what
//! a process costs before `main` counts too. `-- --nodes 1000,10000` measures some sizes only.
//!
//! | row | the process |
//! |---|---|
//! | first check | parses and checks a file that the store does not know, and keeps it compiled |
//! | cold | runs it: the file is checked, no result is stored |
//! | unchanged | runs it again: everything is stored |
//! | leaf changed | runs the file after the last node's parameter was edited in it, so that it is parsed again |
//! | leaf set | the same change as an override, `--set` |

use std::fmt::Write;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;

use gear_graph::{
    Context, GraphSource, Inputs, Library, Node, NodeError, Number, Outputs, Params, Registry, Run, Store, Want,
    peak_memory,
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

/// Every node reads the one before.
fn chain(nodes: usize) -> String {
    let mut text = String::from("gear: 1\ninputs: {x: Number}\nnodes:\n  n0: {node: Add, in: {of: x}}\n");
    for i in 1..nodes {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  n{i}: {{node: Add, in: {{of: n{}.sum}}, with: {{plus: 1}}}}",
            i - 1
        );
    }
    let _ = writeln!(text, "outputs: {{y: n{}.sum}}", nodes - 1);
    text
}

/// One node, all others but the last read it, and the last reads them all.
fn wide(nodes: usize) -> String {
    let mut text = String::from("gear: 1\ninputs: {x: Number}\nnodes:\n  n0: {node: Add, in: {of: x}}\n");
    let mut all = Vec::new();
    for i in 1..nodes - 1 {
        let _ = writeln!(text, "  n{i}: {{node: Add, in: {{of: n0.sum}}, with: {{plus: {i}}}}}");
        all.push(format!("n{i}.sum"));
    }
    let _ = writeln!(
        text,
        "  n{}: {{node: Add, in: {{of: [{}]}}, with: {{plus: 1}}}}",
        nodes - 1,
        all.join(", ")
    );
    let _ = writeln!(text, "outputs: {{y: n{}.sum}}", nodes - 1);
    text
}

/// CPU seconds of all processes that this one started and that have ended, with their threads. The system adds them up
/// in nanoseconds and tells hundredths of a second, so the sum over several processes is better than each.
fn cpu_of_children() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks: f64 = after
        .split_whitespace()
        .skip(13)
        .take(2)
        .filter_map(|n| n.parse::<f64>().ok())
        .fold(0.0, |sum, n| sum + n);
    ticks / 100.0
}

/// The process that is measured: `FILE STORE WHAT`. Prints its peak memory.
fn measured(file: &str, store: &str, what: &str) {
    let mut registry = Registry::new();
    registry.node::<Add>();
    let store = Arc::new(Store::open(store));
    let mut source = GraphSource::open(file, &Library::default()).expect("the file can be read");
    if let Some(set) = what.strip_prefix("set:") {
        source = source.set(set);
    }
    let graph = source.check_in(&registry, &store).expect("a good graph");
    if what != "check" {
        let run = Run::new(&graph).store(store).input_value("x", Number(0.0));
        let outcome = run.go().expect("a good run");
        let ran = outcome.report.ran().len();
        let expected = match what {
            "cold" => graph.nodes().len(),
            "unchanged" => 0,
            _ => 1,
        };
        assert_eq!(ran, expected, "{what}");
    } else {
        drop(store);
    }
    println!("{}", peak_memory().unwrap_or(0));
}

/// CPU seconds of one process, mean of several, and the most memory that one of them held.
struct Figure {
    seconds: f64,
    memory: u64,
}

/// Runs this program anew `times` times. `before` makes things ready for each; it is not counted.
fn figure(times: usize, place: &Place, what: impl Fn(usize) -> String, before: impl Fn(usize)) -> Figure {
    let (mut seconds, mut memory) = (0.0, 0);
    for i in 0..times {
        before(i);
        let spent = cpu_of_children();
        memory = memory.max(place.process(&what(i)));
        seconds += cpu_of_children() - spent;
    }
    Figure {
        seconds: seconds / times as f64,
        memory,
    }
}

/// A graph file and a store.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn file(&self) -> PathBuf {
        self.folder.path().join("graph.yaml")
    }

    fn store(&self) -> PathBuf {
        self.folder.path().join("store")
    }

    fn write(&self, text: &str) {
        std::fs::write(self.file(), text).expect("the folder can be written");
    }

    /// One process; its peak memory.
    fn process(&self, what: &str) -> u64 {
        let output = Command::new(std::env::current_exe().expect("a running program has a path"))
            .arg("--measured")
            .args([self.file(), self.store()])
            .arg(what)
            .output()
            .expect("this program starts");
        let text = String::from_utf8_lossy(&output.stdout);
        let memory = text.trim().parse();
        memory.unwrap_or_else(|_| panic!("{what}: {text}{}", String::from_utf8_lossy(&output.stderr)))
    }
}

/// What each row measures, and the most CPU seconds it may take at 1,000, 10,000 and 100,000 nodes.
const ROWS: [(&str, [f64; 3]); 5] = [
    ("first check", [0.02, 0.2, 2.0]),
    ("cold", [0.05, 0.5, 5.0]),
    ("unchanged", [0.01, 0.06, 0.6]),
    ("leaf changed", [0.015, 0.15, 1.5]),
    ("leaf set", [0.015, 0.15, 1.5]),
];

/// The figures of one graph, in the order of `ROWS`.
fn figures(text: &str, nodes: usize) -> Vec<Figure> {
    let place = Place {
        folder: tempfile::tempdir().expect("a temporary folder"),
    };
    let times = (40_000 / nodes).clamp(2, 20);
    let empty = |_| drop(std::fs::remove_dir_all(place.store()));
    place.write(text);
    let check = figure(times, &place, |_| "check".to_owned(), empty);
    let cold = figure(
        times,
        &place,
        |_| "cold".to_owned(),
        |i| {
            empty(i);
            place.process("check");
        },
    );
    let unchanged = figure(times, &place, |_| "unchanged".to_owned(), |_| ());
    let at = text.rfind("plus: 1}").expect("the last node has a parameter");
    let changed = figure(
        times,
        &place,
        |_| "changed".to_owned(),
        |i| place.write(&format!("{}plus: {}}}{}", &text[..at], 100 + i, &text[at + 8..])),
    );
    place.write(text);
    let set = figure(
        times,
        &place,
        |i| format!("set:n{}.plus={}", nodes - 1, 1000 + i),
        |_| (),
    );
    vec![check, cold, unchanged, changed, set]
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == "--measured") {
        if let [file, store, what] = &arguments[at + 1..] {
            measured(file, store, what);
        }
        return;
    }
    let sizes: Vec<usize> = match arguments.iter().position(|argument| argument == "--nodes") {
        Some(at) => arguments[at + 1..]
            .iter()
            .take(1)
            .flat_map(|list| list.split(','))
            .filter_map(|n| n.parse().ok())
            .collect(),
        None => vec![1_000, 10_000, 100_000],
    };
    println!("CPU seconds of whole processes (peak MB); the bound of each row in the last column");
    for (shape, make) in [("chain", chain as fn(usize) -> String), ("wide", wide)] {
        let columns: Vec<_> = sizes.iter().map(|nodes| figures(&make(*nodes), *nodes)).collect();
        print!("\n| {shape:<12} |");
        sizes.iter().for_each(|nodes| print!(" {nodes:>14} |"));
        println!(" at most |\n|---|{}---|", "---|".repeat(sizes.len()));
        for (i, (row, bounds)) in ROWS.iter().enumerate() {
            print!("| {row:<12} |");
            for column in &columns {
                let figure = &column[i];
                print!(" {:.4} ({:>4}) |", figure.seconds, figure.memory / 1_000_000);
            }
            let bounds: Vec<_> = bounds.iter().map(f64::to_string).collect();
            println!(" {} |", bounds.join(" · "));
        }
    }
}
