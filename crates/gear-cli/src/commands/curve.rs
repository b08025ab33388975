//! `gear curve`: error against run time.

use std::path::{Path, PathBuf};

use clap::Args;
use gear_graph::Registry;
use gear_study::curve::front::better_than_default;
use gear_study::curve::{Curve, Plan};
use gear_study::study::Host;

use crate::bundle::File;
use crate::commands::run::interruption;
use crate::commands::study::{Machine, Painter};
use crate::console::Console;
use crate::error::{CliError, Exit};
use crate::folder::Folder;
use crate::graphs;
use crate::sizes::counted;

/// `gear curve`.
#[derive(Debug, Args)]
pub struct CurveArgs {
    /// A curve file, or `@curves/NAME` for one that comes with gear; a table in CSV is drawn again
    pub curve: String,
    /// Where table and diagram go; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "curves")]
    pub out: PathBuf,
    /// Tell what would be timed, and measure nothing
    #[arg(long)]
    pub dry_run: bool,
    /// How and where it runs.
    #[command(flatten)]
    pub machine: Machine,
}

pub fn curve(args: &CurveArgs, registry: &Registry, console: &Console) -> Result<Exit, CliError> {
    let library = graphs::library();
    let text = library.read(&args.curve)?;
    if args.dry_run && !args.curve.ends_with(".csv") {
        let plan = Plan::read(&args.curve, &text, &library, registry, &Painter).map_err(CliError::Graph)?;
        forecast(&plan, console);
        return Ok(Exit::Done);
    }
    let folder = match args.dry_run {
        true => None,
        false => Some(Folder::probe(&args.out)?),
    };
    let name = Path::new(args.curve.trim_start_matches('@')).file_stem();
    let name = name.unwrap_or_default().to_string_lossy().into_owned();
    let curve = match args.curve.ends_with(".csv") {
        true => Curve::parse(&text).map_err(|cause| CliError::CurveTable {
            file: args.curve.clone(),
            cause,
        })?,
        false => {
            let plan = Plan::read(&args.curve, &text, &library, registry, &Painter).map_err(CliError::Graph)?;
            measure(&plan, &args.machine, console)?
        }
    };
    // The picture shows what stands in the table, to the digit.
    let csv = curve.csv();
    let curve = Curve::parse(&csv).unwrap_or(curve);
    let mut files = vec![File::new(format!("{name}.csv"), csv.into_bytes())];
    files.extend(
        curve
            .svg()
            .map(|svg| File::new(format!("{name}.svg"), svg.into_bytes())),
    );
    let Some(folder) = folder else {
        for file in files {
            let path = args.out.join(&file.name);
            console.result(&format!(
                "{} would be drawn from the table again; nothing is timed",
                path.display()
            ));
        }
        return Ok(Exit::Done);
    };
    for file in files {
        console.result(&folder.write(&file)?.display().to_string());
    }
    match better_than_default(&curve) {
        Ok(better) if better.is_empty() => console.remark("the default is on the front, within 10 %"),
        Ok(better) => {
            let labels: Vec<_> = better.iter().map(|point| point.label.as_str()).collect();
            console.remark(&format!(
                "better than the default by more than 10 %: {}",
                labels.join(" | ")
            ));
        }
        Err(why) => console.remark(&why),
    }
    Ok(Exit::Done)
}

/// What would be timed.
fn forecast(plan: &Plan, console: &Console) {
    let runs = plan.settings.len() * (plan.warm_up + plan.repeats);
    console.result(&format!(
        "{}, each run {} for the clock after {} to warm up: {} in all, and one of the reference",
        counted(plan.settings.len(), "setting"),
        counted(plan.repeats, "time"),
        plan.warm_up,
        counted(runs, "run"),
    ));
    console.result(&format!("timed      {}", plan.time.join(", ")));
    let of = std::iter::once(&plan.output).chain(&plan.path).map(String::as_str);
    console.result(&format!(
        "error      {} of {}",
        plan.norm.name(),
        of.collect::<Vec<_>>().join(".")
    ));
    console.result(&format!("reference  {}", plan.reference.label));
    console.result("settings");
    for setting in &plan.settings {
        let shipped = if setting.default { "  (the default)" } else { "" };
        console.result(&format!("  {}{shipped}", setting.label));
    }
}

fn measure(plan: &Plan, machine: &Machine, console: &Console) -> Result<Curve, CliError> {
    let lender = machine.lender()?;
    let host = Host {
        samples: &Painter,
        store: machine.open_store()?,
        lend: &lender,
        cancel: interruption(),
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let words = format!(
        "{} threads, {}",
        machine.jobs.map_or(cores, usize::from),
        std::env::consts::ARCH
    );
    Ok(plan.measure(&host, &words, &mut |point| {
        console.remark(&format!(
            "{}: {:.4} s, error {:.3e}",
            point.label, point.seconds, point.error
        ));
    })?)
}
