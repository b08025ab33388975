//! What a run leaves in its folder: the outputs as files, its record, its page.
//!
//! # In which order
//!
//! All files are made before one is written. A name that is taken by a file which no earlier run wrote is refused then,
//! before anything of it is lost. Names that are new are announced in the record (its status is `writing` meanwhile):
//! whoever is killed in the middle leaves files that a later run knows for gear's own, and half of none.
//!
//! A file that cannot be written costs that output. The others are written, and the record says what is missing.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use gear_graph::{Graph, Outcome, Report, RunReport, RunStatus};
use serde_json::{Value as Json, json};

use crate::artefacts::Artefacts;
use crate::bundle::{self, File};
use crate::console::Console;
use crate::error::CliError;
use crate::folder::{Folder, RECORD};
use crate::gallery::Gallery;
use crate::outputs;
use crate::page::{Sources, page};

/// The page.
pub const PAGE: &str = "report.html";

/// The files of one output.
struct Bundle {
    output: String,
    type_name: &'static str,
    files: Vec<File>,
}

/// The outputs of a run as files, not written yet.
pub struct Results {
    bundles: Vec<Bundle>,
    /// Outputs that could not be made into files.
    unmade: Vec<CliError>,
}

impl Results {
    /// Makes files of all outputs that are there; what earlier runs made of the same values is taken.
    pub fn gather(outcome: &mut Outcome<'_>, artefacts: &Artefacts) -> Self {
        let mut results = Self {
            bundles: Vec::new(),
            unmade: Vec::new(),
        };
        for output in outcome.report.outputs.clone() {
            let Some(digest) = outcome.digest(&output.name) else {
                continue;
            };
            let kind = outputs::kind(&output.name);
            let stored = artefacts.get(&kind, &digest);
            let made = match stored.and_then(|packed| bundle::unpack(&packed)) {
                Some(files) => Ok(files),
                None => outcome
                    .recover(&output.name)
                    .ok_or_else(|| "its value was lost and could not be computed again".to_owned())
                    .and_then(|value| outputs::files(&output.name, &value))
                    .inspect(|files| drop(artefacts.put(&kind, &digest, bundle::pack(files)))),
            };
            match made {
                Ok(files) => results.bundles.push(Bundle {
                    output: output.name,
                    type_name: output.type_name,
                    files,
                }),
                Err(cause) => results.unmade.push(CliError::Encode {
                    output: output.name,
                    cause,
                }),
            }
        }
        results
    }

    /// Whether no output is there, not even one that cannot be made into files.
    pub fn is_empty(&self) -> bool {
        self.bundles.is_empty() && self.unmade.is_empty()
    }

    /// Whether all outputs that are there were made into files.
    pub fn all_made(&self) -> bool {
        self.unmade.is_empty()
    }

    fn files(&self) -> impl Iterator<Item = &File> {
        self.bundles.iter().flat_map(|bundle| &bundle.files)
    }

    /// Writes everything and tells the names; gives back why outputs are missing.
    ///
    /// # Errors
    /// When a file is in the way, and when not even the announcement can be written. Nothing is written then.
    pub fn write(
        self,
        place: &Place<'_>,
        report: &RunReport,
        graph: &Graph,
        gallery: &Gallery,
    ) -> Result<Vec<CliError>, CliError> {
        let Place { folder, force, console } = *place;
        let earlier = folder.recorded();
        let mut names = BTreeSet::from([RECORD.to_owned(), PAGE.to_owned()]);
        names.extend(self.files().map(|file| file.name.clone()));
        if !force && let Some(file) = folder.stranger(&names, &earlier, &|name| self.bytes_of(name)) {
            return Err(folder.taken(&file));
        }
        let before = folder.bytes(RECORD);
        if !names.is_subset(&earlier) {
            let announced = json!({"status": "writing", "files": names.union(&earlier).collect::<Vec<_>>()});
            folder.write(&File::new(RECORD, announced.to_string().into_bytes()))?;
        }

        let mut missing = Vec::new();
        let mut written = Vec::new();
        let mut reports = BTreeMap::new();
        for bundle in self.bundles {
            let paths: Result<Vec<_>, _> = bundle.files.iter().map(|file| folder.write(file)).collect();
            match paths {
                // The views of one output are one result.
                Ok(paths) if bundle.type_name == "Views" => {
                    written.extend(paths.first().and_then(|first| first.parent()).map(PathBuf::from));
                }
                Ok(paths) => written.extend(paths),
                Err(error) => {
                    missing.push((bundle.output, error));
                    continue;
                }
            }
            if bundle.type_name == "Report"
                && let Some(file) = bundle.files.first()
                && let Ok(read) = serde_json::from_slice(&file.bytes)
            {
                reports.insert(bundle.output, read);
            }
        }
        for error in self.unmade {
            if let CliError::Encode { output, .. } = &error {
                missing.push((output.clone(), error));
            }
        }
        if written.is_empty() && !missing.is_empty() {
            folder.withdraw(before, &names);
            return Ok(missing.into_iter().map(|(_, error)| error).collect());
        }

        // A run that failed takes nothing away; what it leaves standing is still gear's to remove later.
        let stale: BTreeSet<String> = earlier.difference(&names).cloned().collect();
        if report.status == RunStatus::Done && missing.is_empty() {
            let gone = folder.remove(stale.iter());
            if gone > 0 {
                console.note(&format!("{gone} files of an earlier run were removed from the folder"));
            }
        } else {
            names.extend(stale);
        }
        names.retain(|name| name == RECORD || name == PAGE || folder.has(name));
        let record = record(report, &names, &missing);
        let mut add = |name: &str, bytes: Result<Vec<u8>, CliError>| match bytes
            .and_then(|bytes| folder.write(&File::new(name, bytes)))
        {
            Ok(path) => written.push(path),
            Err(error) => missing.push((name.to_owned(), error)),
        };
        add(RECORD, record);
        let page = page(&Sources {
            report,
            graph,
            gallery,
            reports: &reports,
        });
        let html = page.render().map_err(|error| CliError::Encode {
            output: PAGE.to_owned(),
            cause: error.to_string(),
        });
        add(PAGE, html.map(String::into_bytes));
        for path in written {
            console.result(&path.display().to_string());
        }
        Ok(missing.into_iter().map(|(_, error)| error).collect())
    }

    fn bytes_of(&self, name: &str) -> Option<&[u8]> {
        let file = self.files().find(|file| file.name == name)?;
        Some(&file.bytes)
    }
}

/// Where results go.
pub struct Place<'a> {
    /// The folder.
    pub folder: &'a Folder,
    /// Whether files may be replaced that no run wrote.
    pub force: bool,
    /// Who is told.
    pub console: &'a Console,
}

/// The files that a run of these outputs will write, as far as that is known before it.
pub fn foreseen(graph: &Graph, wanted: impl Fn(&str) -> bool) -> BTreeSet<String> {
    let outputs = graph.outputs().iter().filter(|output| wanted(&output.name));
    let files = outputs.flat_map(|output| outputs::foreseen(&output.name, &graph.output_type(output)));
    files.chain([RECORD.to_owned(), PAGE.to_owned()]).collect()
}

/// `run.json`: the report of the run, the files that gear wrote into the folder, and the outputs that it could not.
fn record(report: &RunReport, files: &BTreeSet<String>, missing: &[(String, CliError)]) -> Result<Vec<u8>, CliError> {
    let encode = || {
        let mut record = Report::new(report)?;
        record.0["files"] = files.iter().map(String::as_str).collect();
        if !missing.is_empty() {
            let why = |(output, error): &(String, CliError)| json!({"output": output, "cause": error.to_string()});
            record.0["unwritten"] = missing.iter().map(why).collect::<Vec<Json>>().into();
        }
        gear_graph::Value::encode(&record)
    };
    encode().map_err(|error| CliError::Encode {
        output: RECORD.to_owned(),
        cause: error.to_string(),
    })
}
