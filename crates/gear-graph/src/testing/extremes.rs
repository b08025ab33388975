//! Extreme inputs: a node answers or fails with an error. It does not panic, hang, or give what its output's type
//! declares a flaw, and its answer is the same on one thread and on many, can be stored, and does not read what it did
//! not demand.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use super::cases::{self, Case};
use super::subject::{Bits, Subject};
use crate::{AnyValue, Context, NodeError, Slot};

/// A case that takes longer hangs: extremes are small, and take milliseconds even where a machine is busy.
const HANGS_AFTER: Duration = Duration::from_secs(120);

/// As many failing cases as are told.
const MOST_TOLD: usize = 12;

/// Stack of a thread that runs a case, as the scheduler's threads have it.
pub(super) const STACK: usize = 2 << 20;

/// What a node did with a case: the bits that came out, or its error's message.
type Answer = Result<Bits, String>;

impl Subject {
    /// Feeds the node the extreme cases that the types of its inputs declare, every two of them together: as declared,
    /// and made to go with each other. Optional inputs are also left out, lists are also given all at once.
    ///
    /// # Panics
    /// If the node panics, takes minutes, or gives a value with a [flaw](crate::Value::flaw) or that cannot be stored;
    /// if it gives other bits on another number of threads, or when it is given inputs that it did not demand; if
    /// `demand` and `run` disagree. With every case in which it does.
    pub fn assert_extremes(&self) {
        no_complaint(self.complaint(cases::together(&self.spec.inputs)));
    }

    /// As [`Subject::assert_extremes`], one input extreme at a time and the others as given: one slot a port.
    ///
    /// # Panics
    /// As [`Subject::assert_extremes`].
    pub fn assert_extremes_around(&self, inputs: &[Slot]) {
        no_complaint(self.complaint(cases::around(&self.spec.inputs, inputs)));
    }

    /// [`Subject::assert_extremes`] for several, of which all are told.
    ///
    /// # Panics
    /// As [`Subject::assert_extremes`].
    pub fn assert_all_extremes(subjects: &[Self]) {
        let complaints = subjects
            .iter()
            .filter_map(|subject| subject.complaint(cases::together(&subject.spec.inputs)));
        let complaints: Vec<_> = complaints.collect();
        no_complaint((!complaints.is_empty()).then(|| complaints.join("\n")));
    }

    /// What is wrong with what the node does in these cases.
    fn complaint(&self, cases: Vec<Case>) -> Option<String> {
        if cases.is_empty() {
            return Some(format!("{}: a type of its inputs declares no extremes", self.title));
        }
        let count = cases.len();
        let mut faults = Vec::new();
        for case in cases {
            match self.attempt(case.inputs) {
                Ok(()) => {}
                Err(Fault::Hangs) => {
                    faults.push(format!("{}: no answer in {} s", case.name, HANGS_AFTER.as_secs()));
                    // It still runs, and would take the time of the cases that follow.
                    break;
                }
                Err(Fault::Wrong(what)) => faults.push(format!("{}: {what}", case.name)),
            }
        }
        if faults.is_empty() {
            return None;
        }
        let more = faults.len().saturating_sub(MOST_TOLD);
        let told = faults.iter().take(MOST_TOLD).map(|fault| format!("\n  {fault}"));
        Some(format!(
            "{} breaks its promises in {} of {count} extreme cases:{}{}",
            self.title,
            faults.len(),
            told.collect::<String>(),
            if more > 0 {
                format!("\n  and {more} more")
            } else {
                String::new()
            }
        ))
    }

    /// Runs a case on a thread of its own, so that one that hangs can be told.
    fn attempt(&self, inputs: Vec<Slot>) -> Result<(), Fault> {
        let subject = self.clone();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let (send, receive) = mpsc::channel();
        std::thread::Builder::new()
            .stack_size(STACK)
            .spawn(move || {
                let verdict = catch_unwind(AssertUnwindSafe(|| subject.verdict(&inputs, &stopped)));
                // Nobody listens any more if it took too long.
                let _ = send.send(verdict.unwrap_or_else(|cause| Err(format!("panics: {}", text(&*cause)))));
            })
            .expect("a thread");
        match receive.recv_timeout(HANGS_AFTER) {
            Ok(verdict) => verdict.map_err(Fault::Wrong),
            Err(_) => {
                stop.store(true, Ordering::Relaxed);
                Err(Fault::Hangs)
            }
        }
    }

    fn verdict(&self, inputs: &[Slot], stop: &Arc<AtomicBool>) -> Result<(), String> {
        let demanded = match self.demanded(inputs)? {
            Ok(demanded) => demanded,
            Err(error) => return sensible(&error),
        };
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let first = one
            .expect("a thread pool")
            .install(|| self.answer(demanded.clone(), stop))?;
        if !self.spec.deterministic {
            return Ok(());
        }
        let second = self.answer(demanded.clone(), stop)?;
        if first != second {
            return Err(format!("gives {first:?} on one thread and {second:?} on many"));
        }
        let idle = |i: &usize| demanded[*i].len() != inputs[*i].len();
        if let (Ok(_), Some(i)) = (&first, (0..inputs.len()).find(idle)) {
            let all = self.answer(inputs.to_vec(), stop)?;
            if first != all {
                let port = self.spec.inputs[i].name;
                return Err(format!(
                    "gives other bits when it is given `{port}`, which it did not demand"
                ));
            }
        }
        Ok(())
    }

    /// Runs it; what is wrong with what it gives.
    fn answer(&self, inputs: Vec<Slot>, stop: &Arc<AtomicBool>) -> Result<Answer, String> {
        let ctx = Context::new(Arc::clone(stop), None, 0);
        let outputs = match self.run(inputs, &self.want(|_| true), &ctx) {
            Ok(outputs) => outputs,
            Err(error) => {
                sensible(&error)?;
                return Ok(Err(error.to_string()));
            }
        };
        for (port, value) in self.spec.outputs.iter().zip(&outputs) {
            match value {
                None => return Err(format!("does not give `{}`, which is wanted", port.name)),
                Some(value) => sound(value).map_err(|flaw| format!("`{}` {flaw}", port.name))?,
            }
        }
        Ok(Ok(self.bits(&outputs, &ctx)))
    }
}

/// Fails a test.
fn no_complaint(complaint: Option<String>) {
    if let Some(complaint) = complaint {
        panic!("{complaint}");
    }
}

enum Fault {
    Hangs,
    Wrong(String),
}

/// Whether an error is one that a node may give to a user.
pub(super) fn sensible(error: &NodeError) -> Result<(), String> {
    match error {
        NodeError::Cancelled => Err("says that it was interrupted, and was not".to_owned()),
        NodeError::Unknown { port } => Err(format!("takes the value of `{port}` before it has asked for it")),
        error if error.to_string().contains(crate::node::NOT_DEMANDED) => Err(error.to_string()),
        error if error.to_string().trim().is_empty() => Err("fails without a message".to_owned()),
        _ => Ok(()),
    }
}

/// Whether a result can go on: no flaw, and it is the same when it comes back from the store.
pub(super) fn sound(value: &AnyValue) -> Result<(), String> {
    if let Some(flaw) = value.flaw() {
        return Err(flaw);
    }
    value.summary();
    let bytes = value.encode().map_err(|error| format!("cannot be stored: {error}"))?;
    let back = value
        .value_type()
        .decode(&bytes)
        .map_err(|error| format!("cannot be read back: {error}"))?;
    if back.digest() != value.digest() {
        return Err("is another value when it is read back".to_owned());
    }
    Ok(())
}

pub(super) fn text(cause: &(dyn std::any::Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| cause.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "with no message".to_owned())
}
