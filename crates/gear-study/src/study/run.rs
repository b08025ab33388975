//! Planning and running a study.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use gear_graph::{
    AnyValue, Cancel, Digest, Input, NodeStatus, Number, Outcome, PlannedState, Report, Run, RunMistake, RunStatus,
    Store,
};
use gear_report::picture::Pixels;
use gear_splat::Views;

use super::cases::{Case, Samples, Source};
use super::file::{Measure, Study, Variant};
use super::report::{self, File};
use super::results::{Results, Row};
use super::share::identities;
use crate::painting::painting;
use crate::read::did_you_mean;

/// What a study needs of whoever runs it.
pub struct Host<'h> {
    /// Paints samples.
    pub samples: &'h dyn Samples,
    /// Where results are kept and shared.
    pub store: Arc<Store>,
    /// Adds threads, devices and observers to a run.
    pub lend: &'h (dyn for<'g> Fn(Run<'g>) -> Run<'g> + 'h),
    /// Stops the study when it is raised.
    pub cancel: Cancel,
}

/// Something that happened in a study.
#[derive(Clone, Debug)]
pub enum Step<'s> {
    /// A case goes through a variant.
    Begins {
        /// How many of all pairs are done.
        done: usize,
        /// All pairs.
        of: usize,
        /// The case.
        case: &'s str,
        /// The variant.
        variant: &'s str,
    },
    /// It has gone through.
    Done {
        /// What came out.
        row: &'s Row,
        /// Pictures to write now: they are not kept.
        files: Vec<File>,
    },
}

/// What a study would do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Forecast {
    /// Pairs of a case and a variant.
    pub pairs: usize,
    /// Nodes that all pairs need, each counted for itself: what would run if nothing were shared or stored.
    pub needed: usize,
    /// Nodes of those whose results are stored.
    pub stored: usize,
    /// Node executions, with everything shared.
    pub runs: usize,
    /// Executions that depend on values that are not known yet.
    pub may_run: usize,
    /// The same by variant, in their order: what each adds to those before it.
    pub by_variant: Vec<usize>,
    /// Pairs that cannot begin, and why.
    pub mistakes: Vec<String>,
}

impl std::fmt::Display for Forecast {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let shared = self.needed.saturating_sub(self.stored + self.runs + self.may_run);
        write!(
            f,
            "{} node executions{} instead of {}: {} are shared between variants, {} are stored",
            self.runs,
            match self.may_run {
                0 => String::new(),
                some => format!(", and {some} that depend on values not known yet,"),
            },
            self.needed,
            shared,
            self.stored
        )
    }
}

impl Study {
    /// What would be computed; nothing is.
    pub fn forecast(&self, host: &Host<'_>) -> Forecast {
        let mut forecast = Forecast::default();
        let identities: Vec<_> = self.variants.iter().map(|variant| identities(&variant.graph)).collect();
        forecast.by_variant = vec![0; self.variants.len()];
        for case in &self.cases {
            let mut seen: HashMap<Digest, ()> = HashMap::new();
            for (v, variant) in self.variants.iter().enumerate() {
                forecast.pairs += 1;
                let planned = self
                    .set_up(case, variant, host)
                    .and_then(|run| run.plan().map_err(|m| mistakes(&m)));
                let plan = match planned {
                    Ok(plan) => plan,
                    Err(mistake) => {
                        forecast
                            .mistakes
                            .push(format!("{} · {}: {mistake}", case.name, variant.name));
                        continue;
                    }
                };
                for node in plan.nodes.iter().filter(|node| !node.input) {
                    let counter = match node.state {
                        PlannedState::Runs => &mut forecast.runs,
                        PlannedState::MayRun => &mut forecast.may_run,
                        PlannedState::Cached => &mut forecast.stored,
                        _ => continue,
                    };
                    forecast.needed += 1;
                    let fresh = match identities[v].get(node.id.as_str()) {
                        Some(identity) if node.state != PlannedState::Cached => seen.insert(*identity, ()).is_none(),
                        _ => true,
                    };
                    if fresh {
                        *counter += 1;
                        forecast.by_variant[v] += usize::from(node.state != PlannedState::Cached);
                    }
                }
            }
        }
        forecast
    }

    /// Runs everything, telling what happens. Rows come case by case; an interruption ends them early.
    pub fn run(&self, host: &Host<'_>, tell: &mut dyn FnMut(Step<'_>)) -> Results {
        let of = self.cases.len() * self.variants.len();
        let mut results = Results::default();
        let identities: Vec<_> = self.variants.iter().map(|variant| identities(&variant.graph)).collect();
        'cases: for (c, case) in self.cases.iter().enumerate() {
            let painting = self.views.as_ref().and_then(|_| painting(&case.picture, VIEW).ok());
            let mut times: HashMap<(Digest, String), usize> = HashMap::new();
            for (v, variant) in self.variants.iter().enumerate() {
                let done = results.rows.len();
                tell(Step::Begins {
                    done,
                    of,
                    case: &case.name,
                    variant: &variant.name,
                });
                let (row, files) = self.row((c, case), (v, variant), painting.as_ref(), host);
                if host.cancel.is_raised() {
                    results.interrupted = true;
                    break 'cases;
                }
                for (node, port) in &row.computed {
                    if let Some(identity) = identities[v].get(node.as_str()) {
                        let times = times.entry((*identity, port.clone())).or_default();
                        *times += 1;
                        results.repeated += usize::from(*times > 1);
                    }
                }
                tell(Step::Done { row: &row, files });
                results.rows.push(row);
            }
        }
        results
    }

    /// One case through one variant, and the pictures of it. Whatever goes wrong is in the row.
    fn row(
        &self,
        (c, case): (usize, &Case),
        (v, variant): (usize, &Variant),
        painting: Option<&Pixels>,
        host: &Host<'_>,
    ) -> (Row, Vec<File>) {
        let mut row = Row {
            case: c,
            variant: v,
            values: vec![None; self.measures.len()],
            ..Row::default()
        };
        let run = match self.set_up(case, variant, host) {
            Ok(run) => run,
            Err(failure) => {
                row.failure = Some(failure);
                return (row, Vec::new());
            }
        };
        let outcome = match run.go() {
            Ok(outcome) => outcome,
            Err(found) => {
                row.failure = Some(mistakes(&found));
                return (row, Vec::new());
            }
        };
        let report = &outcome.report;
        row.seconds = report.seconds;
        for node in report.nodes.iter().filter(|node| !node.input) {
            match node.status {
                NodeStatus::Ran => {
                    row.ran.push(node.id.clone());
                    let computed = node.outputs.iter().filter(|port| !port.hit);
                    row.computed
                        .extend(computed.map(|port| (node.id.clone(), port.port.clone())));
                }
                NodeStatus::Cached => row.stored += 1,
                _ => {}
            }
        }
        if report.status != RunStatus::Done {
            let failure = report.failures.first().map(|failure| failure.to_string());
            row.failure = Some(failure.unwrap_or_else(|| "it did not end".to_owned()));
        }
        let mut values: BTreeMap<&str, Option<AnyValue>> = BTreeMap::new();
        for (slot, measure) in row.values.iter_mut().zip(&self.measures) {
            let value = values
                .entry(&measure.output)
                .or_insert_with(|| outcome.value(&measure.output));
            match value.as_ref().map(|value| measure.read(value)) {
                Some(Ok(number)) => *slot = number,
                Some(Err(absent)) => {
                    row.failure.get_or_insert(absent);
                }
                None => {}
            }
        }
        let views = self.views.as_ref().map(|output| shown(&outcome, output));
        let files = report::pictures(self, &mut row, painting, views.unwrap_or_default());
        (row, files)
    }

    fn set_up<'g>(&self, case: &Case, variant: &'g Variant, host: &Host<'_>) -> Result<Run<'g>, String> {
        let graph = &variant.graph;
        let input = |name: &str, source: &Source| {
            let input = graph.inputs().iter().find(|input| input.name == name);
            let input = input.ok_or_else(|| format!("the graph has no input `{name}`"))?;
            match source {
                Source::File(path) => Ok(Input::file(path)),
                Source::Sample(sample) => host.samples.input(sample, input, graph),
            }
        };
        let mut run = Run::new(graph)
            .store(Arc::clone(&host.store))
            .cancel(host.cancel.clone())
            .input(self.input.clone(), input(&self.input, &case.picture)?);
        if let (Some(name), Some(mask)) = (&self.mask, &case.mask) {
            run = run.input(name.clone(), input(name, mask)?);
        }
        let mut outputs: Vec<String> = self.measures.iter().map(|measure| measure.output.clone()).collect();
        outputs.extend(self.views.clone());
        outputs.sort();
        outputs.dedup();
        Ok((host.lend)(run.outputs(outputs)))
    }
}

impl Measure {
    /// The number in a value of its output; `None` if it is there and undefined (`null`).
    ///
    /// # Errors
    /// If the value has no such number: a sentence that names some that it has.
    pub fn read(&self, value: &AnyValue) -> Result<Option<f64>, String> {
        let report = match (value.get::<Number>(), value.get::<Report>()) {
            (Some(number), _) if self.path.is_empty() => return Ok(Some(number.0)),
            (_, Some(report)) => report,
            _ => return Err(format!("measure `{}`: `{}` is no Report", self.name, self.output)),
        };
        let mut place = &report.0;
        for name in &self.path {
            let next = match place {
                serde_json::Value::Null => return Ok(None),
                serde_json::Value::Array(items) => name.parse::<usize>().ok().and_then(|at| items.get(at)),
                other => other.get(name),
            };
            place = next.ok_or_else(|| self.absent(&report.0, "has no"))?;
        }
        match place {
            serde_json::Value::Null => Ok(None),
            serde_json::Value::Number(number) => Ok(number.as_f64()),
            _ => Err(self.absent(&report.0, "has no number at")),
        }
    }

    /// That a report lacks the number, and what it has instead.
    fn absent(&self, report: &serde_json::Value, lacks: &str) -> String {
        let path = self.path.join(".");
        let mut numbers = Vec::new();
        numbers_of("", report, &mut numbers);
        let near = did_you_mean(&path, numbers.iter().map(String::as_str));
        let more = match numbers.len().saturating_sub(SOME) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let some = match numbers.is_empty() {
            true => "no number at all".to_owned(),
            false => numbers[..numbers.len().min(SOME)].join(", ") + &more,
        };
        let near = near.map(|near| format!("; {near}")).unwrap_or_default();
        format!(
            "measure `{}`: the report `{}` {lacks} `{path}`; it has {some}{near}",
            self.name, self.output
        )
    }
}

/// How many numbers are named to somebody who asked for one that is not there.
const SOME: usize = 6;

/// The paths of all numbers of a report, and of those that are undefined.
fn numbers_of(path: &str, json: &serde_json::Value, found: &mut Vec<String>) {
    let below = |key: &str| match path {
        "" => key.to_owned(),
        path => format!("{path}.{key}"),
    };
    match json {
        serde_json::Value::Object(entries) => entries
            .iter()
            .for_each(|(key, json)| numbers_of(&below(key), json, found)),
        serde_json::Value::Array(items) => {
            let items = items.iter().enumerate();
            items.for_each(|(at, json)| numbers_of(&below(&at.to_string()), json, found));
        }
        serde_json::Value::Number(_) | serde_json::Value::Null => found.push(path.to_owned()),
        _ => {}
    }
}

/// A number in a report.
pub(crate) fn number_at(report: &serde_json::Value, path: &[String]) -> Option<f64> {
    let mut place = report;
    for name in path {
        place = match place {
            serde_json::Value::Array(items) => items.get(name.parse::<usize>().ok()?)?,
            other => other.get(name)?,
        };
    }
    place.as_f64()
}

/// Longer side of the pictures that are kept for pages and ballots, in pixels.
const VIEW: usize = 400;

/// The views of an output with their names.
fn shown(outcome: &Outcome<'_>, output: &str) -> Vec<(String, Pixels)> {
    let Some(views) = outcome.value(output).and_then(|value| value.get::<Views>()) else {
        return Vec::new();
    };
    let views = views.views.iter();
    views
        .map(|view| (view.name.clone(), Pixels::of_view(view).at_most(VIEW)))
        .collect()
}

pub(crate) fn mistakes(found: &[RunMistake]) -> String {
    found.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}
