//! `gear check`: every mistake of a graph file at once.

use gear_graph::{GraphSource, Mistakes, Registry, Severity, Unreadable};
use serde_json::{Value, json};

use crate::args::{CheckArgs, CheckFormat};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::graphs;

/// The version of what `--format json` writes.
const FORMAT: u32 = 1;

pub fn check(args: &CheckArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    if args.format == CheckFormat::Json {
        return Ok(for_programs(args, registry, console));
    }
    let graph = graphs::open_for_files(&args.graph, registry)?;
    if !graph.warnings().is_empty() {
        console.remark(graph.warnings().render(console.colour()).trim_end());
    }
    console.result(&format!(
        "{}: no mistakes; {} inputs, {} nodes, {} outputs",
        graph.name(),
        graph.inputs().len(),
        graph.nodes().len(),
        graph.outputs().len()
    ));
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
