//! `gear study`: variants of a graph over many pictures, compared in tables.

mod samples;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use gear_graph::{Mistakes, Registry, Run, Store};
use gear_splat::{Device, DeviceChoice, Fallback};
use gear_study::curve::Plan;
use gear_study::curve::file::is_curve;
use gear_study::study::{self, Host, Step, Study};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::bundle::File;
use crate::commands::plan::not_among_files;
use crate::commands::run::interruption;
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;
use crate::graphs;
use crate::sizes::counted;

pub use samples::Painter;

/// `gear study`.
#[derive(Debug, Args)]
pub struct StudyArgs {
    /// A study file, or `@studies/NAME` for one that comes with gear
    pub study: String,
    /// Tell what would be computed, and compute nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Where the tables go; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "study")]
    pub out: PathBuf,
    /// How and where it runs.
    #[command(flatten)]
    pub machine: Machine,
    /// Tell nothing but warnings and errors on standard error
    #[arg(long, short)]
    pub quiet: bool,
}

/// How and where experiments run.
#[derive(Debug, Args)]
pub struct Machine {
    /// Where results are kept between runs [default: $GEAR_STORE, or `gear` in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub store: Option<PathBuf>,
    /// Threads in all
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// What rasterises: the CPU, or a GPU (by a part of its name); `auto` takes one that is not played by the CPU
    #[arg(long, value_name = "auto|cpu|gpu[:NAME]", default_value_t)]
    pub device: DeviceChoice,
}

impl Machine {
    /// The store, or a mistake: what experiments share, they share over a store.
    pub fn open_store(&self) -> Result<Arc<Store>, CliError> {
        not_among_files(self.store.as_deref())?;
        let path = self.store.clone().or_else(Store::default_path);
        let path = path.ok_or(CliError::NoStore { path: None })?;
        Ok(Arc::new(Store::open(path)))
    }

    /// What is lent to every run.
    pub fn lender(&self) -> Result<impl for<'g> Fn(Run<'g>) -> Run<'g> + use<>, CliError> {
        let fallback = Fallback::telling(|why| Console::new().warning(why)).unless_required();
        let device = Device::open(&self.device, fallback).map_err(CliError::Device)?;
        let jobs = self.jobs.map(usize::from);
        Ok(lend(device, jobs))
    }
}

/// A closure for runs of any graph; the bound makes the compiler see that it is one.
fn lend(device: Device, jobs: Option<usize>) -> impl for<'g> Fn(Run<'g>) -> Run<'g> {
    fn of_any_graph<F: for<'g> Fn(Run<'g>) -> Run<'g>>(f: F) -> F {
        f
    }
    of_any_graph(move |run| {
        let run = run.resource(device.clone());
        match jobs {
            Some(jobs) => run.jobs(jobs),
            None => run,
        }
    })
}

pub fn study(args: &StudyArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let library = graphs::library();
    let text = library.read(&args.study)?;
    let study = Study::read(&args.study, &text, &library, registry, &Painter).map_err(CliError::Graph)?;
    let store = args.machine.open_store()?;
    let lender = args.machine.lender()?;
    let host = Host {
        samples: &Painter,
        store,
        lend: &lender,
        cancel: interruption(),
    };
    if args.dry_run {
        return Ok(forecast(&study, &host, console));
    }
    let folder = Folder::probe(&args.out)?;
    let begun = Instant::now();
    let progress = Progress::new(args.quiet, console);
    let mut unwritten = None;
    let results = study.run(&host, &mut |step| {
        progress.step(&study, &step);
        let files = match step {
            Step::Done { files, .. } => files,
            Step::Begins { .. } => Vec::new(),
        };
        for file in files {
            if let Err(error) = folder.write(&File::new(file.name, file.bytes)) {
                // What comes after it could not be written either.
                host.cancel.raise();
                unwritten.get_or_insert(error);
            }
        }
    });
    progress.bar.finish_and_clear();
    if let Some(error) = unwritten {
        return Err(error);
    }
    if results.interrupted {
        console.remark("interrupted; what was computed is kept, and the next run goes on from there");
        return Ok(Exit::Interrupted);
    }
    let colophon = format!(
        "gear {}, `{}`, {:.0} s on the clock with what was stored before.",
        env!("CARGO_PKG_VERSION"),
        args.study,
        begun.elapsed().as_secs_f64()
    );
    let files = study::report::files(&study, &results, &colophon).map_err(|cause| CliError::Encode {
        output: "study".to_owned(),
        cause,
    })?;
    for file in files {
        let path = folder.write(&File::new(file.name, file.bytes))?;
        console.result(&path.display().to_string());
    }
    if !args.quiet {
        console.remark(&study::report::computed(&study, &results));
    }
    for (m, measure) in study.measures.iter().enumerate() {
        let done = results.rows.iter().filter(|row| row.failure.is_none());
        let undefined = done.filter(|row| row.values[m].is_none()).count();
        if undefined > 0 {
            console.note(&format!(
                "`{}` is undefined in {undefined} of {}: an empty cell each",
                measure.name,
                counted(results.rows.len(), "row")
            ));
        }
    }
    let failed = results.rows.iter().filter(|row| row.failure.is_some()).count();
    if failed > 0 {
        console.warning(&format!(
            "{failed} of {} rows failed; study.md says why",
            results.rows.len()
        ));
        return Ok(Exit::Failed);
    }
    Ok(Exit::Done)
}

fn forecast(study: &Study, host: &Host<'_>, console: &Console) -> Exit {
    let forecast = study.forecast(host);
    console.result(&format!(
        "{} cases × {} variants",
        study.cases.len(),
        study.variants.len()
    ));
    console.result(&format!("{forecast}"));
    let width = study.variants.iter().map(|v| v.name.chars().count()).max().unwrap_or(0);
    for (variant, runs) in study.variants.iter().zip(&forecast.by_variant) {
        console.result(&format!("  {:<width$}  adds {runs}", variant.name));
    }
    for mistake in &forecast.mistakes {
        console.warning(mistake);
    }
    if forecast.mistakes.is_empty() {
        Exit::Done
    } else {
        Exit::Failed
    }
}

/// Whether a file is an experiment instead of a graph.
pub fn is_experiment(text: &str) -> bool {
    study::file::is_study(text) || is_curve(text)
}

/// What is wrong with an experiment; `None` if nothing is.
pub fn mistakes(name: &str, text: &str, registry: &Registry) -> Option<Mistakes> {
    match is_curve(text) {
        true => Plan::read(name, text, &graphs::library(), registry, &Painter).err(),
        false => Study::read(name, text, &graphs::library(), registry, &Painter).err(),
    }
}

/// A bar on a terminal, a line a row in a log.
pub struct Progress {
    bar: ProgressBar,
    lines: bool,
}

impl Progress {
    fn new(quiet: bool, console: &Console) -> Self {
        let bars = console.interactive() && !quiet;
        let target = if bars {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let style = ProgressStyle::with_template("{bar:24.green/dim} {pos}/{len}  {elapsed}  {wide_msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self {
            bar,
            lines: !bars && !quiet,
        }
    }

    fn step(&self, study: &Study, step: &Step<'_>) {
        match step {
            Step::Begins {
                done,
                of,
                case,
                variant,
            } => {
                self.bar.set_length(*of as u64);
                self.bar.set_position(*done as u64);
                self.bar.set_message(format!("{case} · {variant}"));
            }
            Step::Done { row, .. } => {
                if self.lines {
                    let (case, variant) = (&study.cases[row.case].name, &study.variants[row.variant].name);
                    let end = match &row.failure {
                        Some(failure) => format!("failed: {}", failure.lines().next().unwrap_or_default()),
                        None => format!(
                            "{} nodes ran, {} stored, {:.1} s",
                            row.ran.len(),
                            row.stored,
                            row.seconds
                        ),
                    };
                    Console::new().remark(&format!("{case} · {variant}: {end}"));
                }
            }
        }
    }
}
