//! `gear run`: runs a graph and writes what it puts out.
//!
//! The order matters. Everything that can be wrong with what was asked for is found before anything runs and before
//! anything is written; a file that cannot be decoded is found while it is loaded, and then nothing is written either.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use gear_graph::{Event, FailureKind, Outcome, Registry, Report, RunReport, RunStatus};

use crate::args::RunArgs;
use crate::artefacts::Artefacts;
use crate::bundle::{self, File};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::{Folder, RECORD};
use crate::gallery::Gallery;
use crate::outputs;
use crate::page::{Sources, page};
use crate::progress::{Progress, Show};

use super::plan::{open, open_store, set_up};

/// The page.
const PAGE: &str = "report.html";

pub fn run(args: &RunArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let store = open_store(&args.run, console);
    let graph = open(&args.run, registry, store.as_deref(), console)?;
    let mut run = set_up(&args.run, &graph, store.clone())?;
    let folder = Folder::probe(&args.out)?;
    spare_what_is_read(&folder, args, &graph)?;
    let artefacts = Arc::new(Artefacts::new(store));
    let gallery = Arc::new(Gallery::open(Arc::clone(&artefacts)));
    let progress = Arc::new(Progress::new(how_to_show(args.quiet, console)));

    let observer = {
        let (gallery, progress) = (Arc::clone(&gallery), Arc::clone(&progress));
        move |event: &Event<'_>| {
            gallery.event(event);
            progress.event(event);
            tell(event, &progress);
        }
    };
    if args.fail_fast {
        run = run.fail_fast();
    }
    if let Some(limit) = args.memory {
        run = run.memory_limit(limit);
    }
    let interrupted = interruption();
    let run = run.cancel(Arc::clone(&interrupted)).observer(Arc::new(observer));
    let outcome = run.go().map_err(CliError::Run)?;
    progress.finish();
    gallery.finish();

    let report = &outcome.report;
    for failure in &report.failures {
        console.failure(&failure.to_string());
    }
    let bad_input = report.failures.iter().any(|failure| failure.kind == FailureKind::Load);
    if bad_input {
        return Ok(Exit::Mistake);
    }
    let stopped = || {
        console.remark("interrupted; what was computed is kept, and the next run goes on from there");
        Ok(Exit::Interrupted)
    };
    if report.status == RunStatus::Interrupted {
        return stopped();
    }
    match write(&folder, &outcome, &artefacts, &gallery, &graph, console) {
        // A value that the store had lost was being computed again.
        Err(CliError::Encode { .. }) if interrupted.load(Ordering::Relaxed) => return stopped(),
        written => written?,
    }
    if !args.quiet {
        console.remark(&summary(report));
    }
    Ok(if report.status == RunStatus::Done {
        Exit::Done
    } else {
        Exit::Failed
    })
}

/// Refuses to write results over the files that the run reads.
fn spare_what_is_read(folder: &Folder, args: &RunArgs, graph: &gear_graph::Graph) -> Result<(), CliError> {
    let given = &args.run;
    let files = given.input.iter().filter_map(|input| Some(input.split_once('=')?.1));
    let files = files.filter(|file| !file.starts_with("sample:"));
    let wanted = |name: &str| given.output.is_empty() || given.output.iter().any(|output| output == name);
    let names: BTreeSet<&str> = graph
        .outputs()
        .iter()
        .map(|o| o.name.as_str())
        .filter(|o| wanted(o))
        .collect();
    for file in files.chain([given.graph.graph.as_str()]) {
        if let Some(name) = folder.name_of(Path::new(file))
            && (name == RECORD || name == PAGE || names.contains(name.split(['.', '/']).next().unwrap_or_default()))
        {
            return Err(CliError::OutFolder {
                folder: args.out.clone(),
                cause: format!(
                    "`{name}` in it is read by this run, and a result may take its name; choose another folder"
                ),
            });
        }
    }
    Ok(())
}

fn how_to_show(quiet: bool, console: &Console) -> Show {
    match (quiet, console.interactive()) {
        (true, _) => Show::Nothing,
        (false, true) => Show::Bars,
        (false, false) => Show::Lines,
    }
}

/// A flag that the first Ctrl-C sets. The second ends the process.
fn interruption() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    let installed = ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    if let Err(error) = installed {
        tracing::warn!(%error, "Ctrl-C will end the process at once");
    }
    flag
}

/// What people should hear while the run goes on.
fn tell(event: &Event<'_>, progress: &Progress) {
    let console = Console::new();
    match event {
        Event::Warning { message } => progress.between(|| console.warning(message)),
        Event::Note { node, note } => progress.between(|| console.note(&format!("{node}: {note}"))),
        _ => {}
    }
}

/// Writes the outputs, the record and the page; tells their names.
fn write(
    folder: &Folder,
    outcome: &Outcome<'_>,
    artefacts: &Artefacts,
    gallery: &Gallery,
    graph: &gear_graph::Graph,
    console: &Console,
) -> Result<(), CliError> {
    let earlier = folder.recorded();
    let mut reports = BTreeMap::new();
    let mut written = Vec::new();
    let mut names = BTreeSet::from([RECORD.to_owned(), PAGE.to_owned()]);
    for output in &outcome.report.outputs {
        let Some(digest) = outcome.digest(&output.name) else {
            continue;
        };
        let encode_error = |cause: String| CliError::Encode {
            output: output.name.clone(),
            cause,
        };
        let kind = format!("files {} {}", outputs::FILES_VERSION, output.name);
        let files = match artefacts.get(&kind, &digest).and_then(|packed| bundle::unpack(&packed)) {
            Some(files) => files,
            None => {
                let value = outcome
                    .value(&output.name)
                    .ok_or_else(|| encode_error("its value was lost and could not be computed again".to_owned()))?;
                let files = outputs::files(&output.name, &value).map_err(encode_error)?;
                artefacts.put(&kind, &digest, bundle::pack(&files));
                files
            }
        };
        if output.type_name == "Report"
            && let Some(file) = files.first()
            && let Ok(report) = serde_json::from_slice(&file.bytes)
        {
            reports.insert(output.name.clone(), report);
        }
        let mut paths = Vec::new();
        for file in &files {
            names.insert(file.name.clone());
            paths.push(folder.write(file)?);
        }
        // The views of one output are one result.
        match paths.first().and_then(|first| first.parent()) {
            Some(parent) if output.type_name == "Views" => written.push(parent.to_path_buf()),
            _ => written.append(&mut paths),
        }
    }
    // A run that failed takes nothing away; what it leaves standing is still gear's to remove later.
    let stale: BTreeSet<String> = earlier.difference(&names).cloned().collect();
    if outcome.report.status == RunStatus::Done {
        let gone = folder.remove(stale.iter());
        if gone > 0 {
            console.note(&format!("{gone} files of an earlier run were removed from the folder"));
        }
    } else {
        names.extend(stale);
    }
    written.push(folder.write(&File::new(RECORD, record(&outcome.report, &names)?))?);
    let page = page(&Sources {
        report: &outcome.report,
        graph,
        gallery,
        reports: &reports,
    });
    let html = page.render().map_err(|error| CliError::Encode {
        output: PAGE.to_owned(),
        cause: error.to_string(),
    })?;
    written.push(folder.write(&File::new(PAGE, html.into_bytes()))?);
    for path in written {
        console.result(&path.display().to_string());
    }
    Ok(())
}

/// `run.json`: the report of the run, and the files that gear wrote into the folder.
fn record(report: &RunReport, files: &BTreeSet<String>) -> Result<Vec<u8>, CliError> {
    let encode = || {
        let mut record = Report::new(report)?;
        record.0["files"] = files.iter().map(String::as_str).collect();
        gear_graph::Value::encode(&record)
    };
    encode().map_err(|error| CliError::Encode {
        output: RECORD.to_owned(),
        cause: error.to_string(),
    })
}

/// One line: how long, what ran, what came from the store.
fn summary(report: &RunReport) -> String {
    let count = |status| report.with_status(status).len();
    let memory = report
        .peak_memory
        .map(|peak| format!(", {} MiB at most", peak >> 20))
        .unwrap_or_default();
    format!(
        "{:.1} s{memory}: {} ran, {} from the store, {} left out",
        report.seconds,
        report.ran().len(),
        count(gear_graph::NodeStatus::Cached),
        count(gear_graph::NodeStatus::LeftOut),
    )
}
