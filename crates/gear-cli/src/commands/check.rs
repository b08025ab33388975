//! `gear check`: every mistake of a graph file at once.

use gear_graph::{GraphSource, Mistakes, Registry, Severity, Unreadable};
use serde_json::{Value, json};

use crate::args::{CheckArgs, CheckFormat};
use crate::commands::study;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::graphs;
use crate::sizes::counted;

/// The version of what `--format json` writes.
const FORMAT: u32 = 1;

pub fn check(args: &CheckArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    if let Ok(text) = graphs::library().read(&args.graph.graph)
        && study::is_experiment(&text)
    {
        return experiment(args, &text, registry, console);
    }
    if args.format == CheckFormat::Json {
        return Ok(for_programs(args, registry, console));
    }
    let graph = graphs::open_for_files(&args.graph, registry)?;
    if !graph.warnings().is_empty() {
        console.remark(graph.warnings().render(console.colour()).trim_end());
    }
    console.result(&format!(
        "{}: no mistakes; {}, {}, {}",
        graph.name(),
        counted(graph.inputs().len(), "input"),
        counted(graph.nodes().len(), "node"),
        counted(graph.outputs().len(), "output")
    ));
    Ok(Exit::Done)
}

/// A study or a curve instead of a graph.
fn experiment(args: &CheckArgs, text: &str, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let name = &args.graph.graph;
    let found = study::mistakes(name, text, registry).unwrap_or_default();
    if args.format == CheckFormat::Json {
        let answer = json!({
            "format": FORMAT, "graph": name, "files": [name], "errors": found.problems().len(), "warnings": 0,
            "mistakes": found.to_json(),
        });
        console.result(&format!("{answer:#}"));
        return Ok(if found.is_empty() { Exit::Done } else { Exit::Mistake });
    }
    if !found.is_empty() {
        return Err(CliError::Graph(found));
    }
    console.result(&format!("{name}: no mistakes"));
    Ok(Exit::Done)
}

/// Everything that can be said goes to standard output; a file that cannot be read is a mistake as well.
fn for_programs(args: &CheckArgs, registry: &Registry, console: &Console) -> Exit {
    let (files, mistakes) = match graphs::source(&args.graph) {
        Ok(source) => checked(&source, registry),
        Err(unreadable) => (vec![args.graph.graph.clone()], json!([no_place(&unreadable)])),
    };
    let of = |severity: &str| {
        let mistakes = mistakes.as_array().into_iter().flatten();
        mistakes.filter(|mistake| mistake["severity"] == severity).count()
    };
    let errors = of("error");
    let answer = json!({
        "format": FORMAT,
        "graph": args.graph.graph,
        "files": files,
        "errors": errors,
        "warnings": of("warning"),
        "mistakes": mistakes,
    });
    console.result(&format!("{answer:#}"));
    if errors > 0 { Exit::Mistake } else { Exit::Done }
}

/// The files that were read, and the mistakes in them.
fn checked(source: &GraphSource, registry: &Registry) -> (Vec<String>, Value) {
    let names = |mistakes: &Mistakes| mistakes.files().map(str::to_owned).collect();
    match source.check_for_files(registry) {
        Ok(graph) => {
            let files = graph.files().iter().map(|file| file.name.clone());
            (files.collect(), graph.warnings().to_json())
        }
        Err(mistakes) => (names(&mistakes), mistakes.to_json()),
    }
}

fn no_place(unreadable: &Unreadable) -> Value {
    json!({
        "code": "unreadable-graph",
        "severity": Severity::Error,
        "message": format!("the graph `{}` cannot be read: {}", unreadable.name, unreadable.cause),
        "help": unreadable.help,
        "file": unreadable.name,
        "start": null,
        "end": null,
        "labels": [],
    })
}
