//! `gear cache`: looks after the store.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use gear_graph::{ArchiveError, Archived, Registry, Store, StoreStat, Verified};
use gear_splat::DeviceChoice;

use crate::args::{CacheCommand, ExportArgs, GraphArgs, PlanArgs, StoreArgs, TextFormat};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::sizes;

use super::plan;

pub fn cache(command: &CacheCommand, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    match command {
        CacheCommand::Stat { store, format } => stat(&Store::look_at(existing(store)?), *format, console),
        CacheCommand::Gc { store, limit } => gc(&open(store, console)?, *limit, console),
        CacheCommand::Verify { store, repair } => verify(&open(store, console)?, *repair, registry, console),
        CacheCommand::Clear { store } => clear(&open(store, console)?, console),
        CacheCommand::Export(args) => export(args, registry, console),
        CacheCommand::Import { file, store } => {
            plan::not_among_files(store.store.as_deref())?;
            let path = path(store)?;
            // The only one that may make a store: not for a file that is none.
            if !Store::exists(&path) {
                Store::check_archive(file).map_err(CliError::Archive)?;
            }
            let store = Store::open(path);
            let archived = store.import(file).map_err(CliError::Archive)?;
            console.result(&format!("{}: {}", store.path().display(), imported(&archived)));
            Ok(Exit::Done)
        }
    }
}

fn path(args: &StoreArgs) -> Result<PathBuf, CliError> {
    let path = args.store.clone().or_else(Store::default_path);
    path.ok_or(CliError::NoStore { path: None })
}

/// Where the store is, which must be there: a folder that gear did not make is never touched.
fn existing(args: &StoreArgs) -> Result<PathBuf, CliError> {
    let path = path(args)?;
    if Store::exists(&path) {
        Ok(path)
    } else {
        Err(CliError::NoStore { path: Some(path) })
    }
}

/// The store, to change it.
fn open(args: &StoreArgs, console: &Console) -> Result<Store, CliError> {
    let store = Store::open(existing(args)?);
    for warning in store.warnings() {
        console.warning(&warning);
    }
    Ok(store)
}

fn failed(store: &Store) -> impl Fn(std::io::Error) -> CliError + '_ {
    |cause| CliError::Store {
        path: store.path().to_path_buf(),
        cause,
    }
}

fn stat(store: &Store, format: TextFormat, console: &Console) -> Result<Exit, CliError> {
    let stat = store.stat();
    match format {
        TextFormat::Text => {
            for line in told(&stat, store) {
                console.result(&line);
            }
        }
        TextFormat::Json => {
            let mut json = serde_json::json!(stat);
            json["path"] = store.path().display().to_string().into();
            console.result(&format!("{json:#}"));
        }
    }
    Ok(Exit::Done)
}

fn told(stat: &StoreStat, store: &Store) -> Vec<String> {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs());
    let ago = |then: u64| sizes::span(now.saturating_sub(then));
    let total = stat.content_bytes + stat.log_bytes;
    let share = 100.0 * total as f64 / stat.limit.max(1) as f64;
    let mut lines = vec![
        format!("store     {}", store.path().display()),
        format!(
            "size      {} of {} ({share:.1} %): contents {}, logs {}",
            sizes::bytes(total),
            sizes::bytes(stat.limit),
            sizes::bytes(stat.content_bytes),
            sizes::bytes(stat.log_bytes)
        ),
        format!(
            "holds     {}, {}, {}, {}",
            sizes::counted(stat.actions, "action"),
            sizes::counted(stat.demands, "demand"),
            sizes::counted(stat.blobs, "artefact"),
            sizes::counted(stat.contents, "content file")
        ),
    ];
    if let Some((first, last)) = stat.made {
        lines.push(format!("age       oldest action {}, newest {}", ago(first), ago(last)));
    }
    if let Some(used) = stat.least_recently_used {
        lines.push(format!(
            "last use  of the content that rests longest: {} ago",
            ago(used)
        ));
    }
    if !stat.types.is_empty() {
        lines.push(format!(
            "{:<12} {:>8} {:>8} {:>11} {:>12}",
            "type", "actions", "values", "size", "took"
        ));
    }
    for (name, of_type) in &stat.types {
        lines.push(format!(
            "{name:<12} {:>8} {:>8} {:>11} {:>10.1} s",
            of_type.actions,
            of_type.values,
            sizes::bytes(of_type.bytes),
            of_type.seconds
        ));
    }
    lines
}

fn gc(store: &Store, limit: u64, console: &Console) -> Result<Exit, CliError> {
    let collected = store.gc(limit).map_err(failed(store))?;
    console.result(&format!(
        "{}: {} removed ({}), {} left",
        store.path().display(),
        sizes::counted(collected.files, "file"),
        sizes::bytes(collected.bytes),
        sizes::bytes(collected.left)
    ));
    Ok(Exit::Done)
}

fn verify(store: &Store, repair: bool, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let types = |name: &str| registry.find_value(name);
    let verified = store.verify(&types, repair).map_err(failed(store))?;
    for problem in &verified.problems {
        console.result(problem);
    }
    for foreign in &verified.foreign {
        console.note(&format!("{foreign}: not put there by gear; left alone"));
    }
    for (name, count) in &verified.unknown_types {
        console.note(&format!(
            "not decoded: {} of the type {name}, which is not known here",
            sizes::counted(*count, "value")
        ));
    }
    let read = read(&verified);
    let path = store.path().display();
    console.result(&match (verified.problems.len(), repair) {
        (0, _) => format!("{path}: all is well: {read}"),
        (bad, true) => format!(
            "{path}: {}, and removed; good are {read}",
            sizes::counted(bad, "problem")
        ),
        (bad, false) => {
            let bad = sizes::counted(bad, "problem");
            format!("{path}: {bad}; good are {read}; `gear cache verify --repair` removes what is bad")
        }
    });
    Ok(match (verified.problems.is_empty(), repair) {
        (false, false) => Exit::Failed,
        _ => Exit::Done,
    })
}

fn clear(store: &Store, console: &Console) -> Result<Exit, CliError> {
    let collected = store.clear().map_err(failed(store))?;
    console.result(&format!(
        "{}: {} removed ({})",
        store.path().display(),
        sizes::counted(collected.files, "file"),
        sizes::bytes(collected.bytes)
    ));
    Ok(Exit::Done)
}

fn export(args: &ExportArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let store_path = existing(&args.store)?;
    let store = Store::look_at(store_path.clone());
    let archived = match &args.graph {
        None => store.export(&args.file).map_err(|error| nothing(error, None))?,
        Some(name) => {
            let asked = PlanArgs {
                graph: GraphArgs {
                    graph: name.clone(),
                    set: args.set.clone(),
                },
                input: args.input.clone(),
                output: args.output.clone(),
                jobs: None,
                store: Some(store.path().to_path_buf()),
                fresh: Vec::new(),
                no_cache: false,
                cache_nondeterministic: false,
                device: DeviceChoice::default(),
                onnxruntime: None,
                no_elision: false,
            };
            let store = Arc::new(store);
            let graph = plan::open(&asked, registry, Some(&store), console)?;
            let run = plan::set_up(&asked, &graph, Some(Arc::clone(&store)))?;
            let exported = store.export_run(&args.file, &run).map_err(CliError::Run)?;
            let (archived, missing) = exported.map_err(|error| nothing(error, Some(name)))?;
            if missing > 0 {
                console.note(&format!(
                    "{} of this run {} not in the store; `gear run` first, to export all of it",
                    sizes::counted(missing, "node"),
                    if missing == 1 { "is" } else { "are" }
                ));
            }
            archived
        }
    };
    if archived.lost > 0 {
        let (are, digests) = match archived.lost {
            1 => ("is", "its digest"),
            _ => ("are", "their digests"),
        };
        console.warning(&format!(
            "{} {are} known by {digests} only and not in the archive, collected or damaged; \
             `gear run` computes again what it needs of that, to export it",
            sizes::counted(archived.lost, "result")
        ));
    }
    console.result(&format!(
        "{}: {} ({})",
        args.file.display(),
        records_and_contents(archived.records, archived.contents, ", "),
        sizes::bytes(archived.bytes)
    ));
    Ok(Exit::Done)
}

/// An export that found nothing, with what to do; any other error as it is.
fn nothing(error: ArchiveError, graph: Option<&str>) -> CliError {
    match (error, graph) {
        (ArchiveError::Nothing { path }, graph) => CliError::NothingToExport {
            path,
            graph: graph.map(str::to_owned),
        },
        (error, _) => CliError::Archive(error),
    }
}

/// What was found sound.
fn read(verified: &Verified) -> String {
    format!(
        "{} ({}), {}",
        records_and_contents(verified.records, verified.contents, ", "),
        sizes::bytes(verified.bytes),
        sizes::counted(verified.values, "value")
    )
}

/// What a store or an archive holds.
fn records_and_contents(records: usize, contents: usize, between: &str) -> String {
    let (records, contents) = (sizes::counted(records, "record"), sizes::counted(contents, "content"));
    format!("{records}{between}{contents}")
}

fn imported(archived: &Archived) -> String {
    format!(
        "{} ({}) imported, {} of them new",
        records_and_contents(archived.records, archived.contents, " and "),
        sizes::bytes(archived.bytes),
        archived.new
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_a_thing_is_told_as_one() {
        let mut verified = Verified {
            records: 1,
            contents: 1,
            bytes: 3,
            values: 1,
            ..Verified::default()
        };
        assert_eq!(read(&verified), "1 record, 1 content (3 B), 1 value");
        (verified.records, verified.contents, verified.values) = (2, 0, 5);
        assert_eq!(read(&verified), "2 records, 0 contents (3 B), 5 values");
        assert_eq!(records_and_contents(1, 2, ", "), "1 record, 2 contents");
        let archived = Archived {
            records: 1,
            contents: 1,
            bytes: 3,
            new: 1,
            lost: 0,
        };
        assert_eq!(
            imported(&archived),
            "1 record and 1 content (3 B) imported, 1 of them new"
        );
    }
}
