//! Measuring a curve.
//!
//! What comes before the nodes that are timed is computed once and stored; then each setting is run with these nodes
//! fresh, so that nothing of them comes from the store, first to warm up and then for the clock. The median counts. What
//! comes behind the output that is compared is never run.

use std::sync::Arc;

use gear_graph::{AnyValue, Input, NodeStatus, Outcome, Run, RunStatus};

use super::file::{Operations, Plan, Setting};
use super::table::{Curve, Point};
use crate::norms::between;
use crate::stats::median;
use crate::study::cases::Source;
use crate::study::run::{Host, mistakes, number_at};

/// Why a curve could not be measured.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CurveError {
    /// A run of a setting failed.
    #[error("{setting}: {cause}")]
    Run {
        /// The setting.
        setting: String,
        /// Why.
        cause: String,
    },
    /// It was interrupted.
    #[error("interrupted")]
    Interrupted,
}

impl Plan {
    /// Measures every setting, and tells each point as it is known.
    pub fn measure(&self, host: &Host<'_>, machine: &str, tell: &mut dyn FnMut(&Point)) -> Result<Curve, CurveError> {
        let reference = self.go(&self.reference, host, false)?;
        let reference = self.value(&self.reference, &reference)?;
        let mut points = Vec::new();
        for setting in &self.settings {
            let mut seconds = Vec::new();
            let mut last = None;
            for round in 0..self.warm_up + self.repeats {
                let outcome = self.go(setting, host, true)?;
                if round >= self.warm_up {
                    seconds.push(self.seconds(setting, &outcome)?);
                }
                last = Some(outcome);
            }
            let Some(outcome) = last else {
                continue; // `repeats` is 1 at least
            };
            let value = self.value(setting, &outcome)?;
            let error = self.error(&value, &reference).map_err(|cause| failed(setting, cause))?;
            let point = Point {
                label: setting.label.clone(),
                family: setting.family.clone(),
                seconds: median(&seconds).unwrap_or(f64::NAN),
                operations: self.operations(setting, &outcome),
                error,
                default: setting.default,
            };
            tell(&point);
            points.push(point);
        }
        let of = std::iter::once(self.output.as_str()).chain(self.path.iter().map(String::as_str));
        Ok(Curve {
            title: self.title.clone(),
            norm: format!(
                "{} of {}, against {}",
                self.norm.name(),
                of.collect::<Vec<_>>().join("."),
                self.reference.label
            ),
            operations: self.operations.as_ref().map(ToString::to_string),
            machine: machine.to_owned(),
            decision: self.decision.clone(),
            points,
        })
    }

    fn go<'p>(&'p self, setting: &'p Setting, host: &Host<'_>, fresh: bool) -> Result<Outcome<'p>, CurveError> {
        let graph = &setting.graph;
        let input = |name: &str| -> Result<Input, CurveError> {
            let unknown = || failed(setting, format!("the graph has no input `{name}`"));
            let input = graph
                .inputs()
                .iter()
                .find(|input| input.name == name)
                .ok_or_else(unknown)?;
            match &self.picture {
                Source::File(path) => Ok(Input::file(path)),
                Source::Sample(sample) => host
                    .samples
                    .input(sample, input, graph)
                    .map_err(|cause| failed(setting, cause)),
            }
        };
        let mut run = Run::new(graph)
            .store(Arc::clone(&host.store))
            .cancel(host.cancel.clone())
            .input(self.input.clone(), input(&self.input)?);
        if let (Some(mask), Source::Sample(_)) = (&self.mask, &self.picture) {
            run = run.input(mask.clone(), input(mask)?);
        }
        let mut outputs = vec![self.output.clone()];
        if let Some(Operations::Report { output, .. }) = &self.operations {
            outputs.push(output.clone());
        }
        outputs.dedup();
        if fresh {
            for node in &self.time {
                run = run.fresh(node.clone());
            }
        }
        let outcome = (host.lend)(run.outputs(outputs))
            .go()
            .map_err(|found| failed(setting, mistakes(&found)));
        if host.cancel.is_raised() {
            return Err(CurveError::Interrupted);
        }
        let outcome = outcome?;
        if outcome.report.status != RunStatus::Done {
            let cause = outcome.report.failures.first().map(ToString::to_string);
            return Err(failed(setting, cause.unwrap_or_else(|| "it did not end".to_owned())));
        }
        Ok(outcome)
    }

    fn seconds(&self, setting: &Setting, outcome: &Outcome<'_>) -> Result<f64, CurveError> {
        let mut seconds = 0.0;
        for name in &self.time {
            match outcome.report.node(name) {
                Some(node) if node.status == NodeStatus::Ran => seconds += node.seconds,
                // An elided node costs nothing; that is what the setting gains.
                Some(node) if node.status == NodeStatus::LeftOut => {}
                _ => return Err(failed(setting, format!("`{name}` did not run, so it cannot be timed"))),
            }
        }
        Ok(seconds)
    }

    fn value(&self, setting: &Setting, outcome: &Outcome<'_>) -> Result<AnyValue, CurveError> {
        let value = outcome.value(&self.output);
        value.ok_or_else(|| failed(setting, format!("the output `{}` was lost", self.output)))
    }

    fn error(&self, value: &AnyValue, reference: &AnyValue) -> Result<f64, String> {
        if self.path.is_empty() {
            return between(value, reference).map(|distance| self.norm.of(&distance));
        }
        let number = |value: &AnyValue| {
            let report = value.get::<gear_graph::Report>();
            let number = report.and_then(|report| number_at(&report.0, &self.path));
            number.ok_or_else(|| format!("`{}.{}` is no number", self.output, self.path.join(".")))
        };
        Ok((number(value)? - number(reference)?).abs())
    }

    fn operations(&self, setting: &Setting, outcome: &Outcome<'_>) -> Option<f64> {
        match self.operations.as_ref()? {
            Operations::Knobs { knobs, .. } => knobs
                .iter()
                .try_fold(1.0, |product, knob| Some(product * (*setting.numbers.get(*knob)?)?)),
            Operations::Report { output, path } => {
                let report = outcome.value(output)?.get::<gear_graph::Report>()?;
                number_at(&report.0, path)
            }
        }
    }
}

fn failed(setting: &Setting, cause: impl Into<String>) -> CurveError {
    CurveError::Run {
        setting: setting.label.clone(),
        cause: cause.into(),
    }
}
