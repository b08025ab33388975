//! One node on one set of inputs, and what it did: for those who look at many cases and judge for themselves.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use super::extremes::{STACK, sensible, sound, text};
use super::{Subject, cases};
use crate::{AnyValue, Context, GraphNode, NodeType, ParamValues, Problem, Resources, Slot};

/// What a node did with its inputs.
#[derive(Clone, Debug)]
pub enum Tried {
    /// It gave all of its outputs, in the order of its ports.
    Answered(Vec<(&'static str, AnyValue)>),
    /// It failed with an error that it may give: the message.
    Refused(String),
    /// It broke a promise of every node: it panicked, left an output out, gave a value with a
    /// [flaw](crate::Value::flaw) or one that cannot be stored, or said something that makes no sense.
    Broke(String),
    /// It gave no answer in the time that it was given.
    Hangs,
}

/// A trial.
#[derive(Clone, Debug)]
pub struct Trial {
    /// What the node did.
    pub tried: Tried,
    /// Seconds on the clock of its run alone.
    pub seconds: f64,
    /// The notes that it left for the user.
    pub notes: Vec<String>,
}

impl Subject {
    /// A node of a graph, with its parameters there.
    pub fn of_graph(node: &GraphNode) -> Self {
        Self {
            node: Arc::clone(&node.node),
            spec: Arc::clone(&node.spec),
            title: node.id.clone(),
        }
    }

    /// Whether these parameters are refused, as a graph would refuse them: the mistakes, or what
    /// [`crate::Node::check`] says.
    pub fn refusal(node_type: &NodeType, params: &serde_json::Value) -> Option<String> {
        let causes = |problems: Vec<Problem>| {
            let messages: Vec<_> = problems.into_iter().map(|problem| problem.message).collect();
            messages.join("; ")
        };
        match Self::of(node_type, params) {
            Err(problems) => Some(causes(problems)),
            Ok(subject) => subject.node.check().err().map(|error| error.to_string()),
        }
    }

    /// Tries the node on inputs, one slot a port. Lazy ports reach it only if it demands them. A run that takes longer
    /// than `patience` is asked to stop and told as [`Tried::Hangs`].
    pub fn attempt_on(&self, inputs: Vec<Slot>, resources: &Resources, patience: Duration) -> Trial {
        let subject = self.clone();
        let stop = Arc::new(AtomicBool::new(false));
        let ctx = Context::new(Arc::clone(&stop), None, 0).with_resources(resources.clone());
        let heard = ctx.clone();
        let (send, receive) = mpsc::channel();
        let worker = std::thread::Builder::new().stack_size(STACK).spawn(move || {
            let started = Instant::now();
            let tried = catch_unwind(AssertUnwindSafe(|| subject.tried(&inputs, &ctx)));
            let tried = tried.unwrap_or_else(|cause| (Tried::Broke(format!("panics: {}", text(&*cause))), None));
            // Nobody listens any more if it took too long.
            let _ = send.send((tried.0, tried.1.unwrap_or_else(|| started.elapsed())));
        });
        let answer = match worker {
            Ok(_) => receive.recv_timeout(patience).ok(),
            Err(error) => Some((
                Tried::Broke(format!("there is no thread for it: {error}")),
                Duration::ZERO,
            )),
        };
        let (tried, spent) = answer.unwrap_or_else(|| {
            stop.store(true, Ordering::Relaxed);
            (Tried::Hangs, patience)
        });
        Trial {
            tried,
            seconds: spent.as_secs_f64(),
            notes: heard.notes(),
        }
    }

    /// What the node did, and the time of its run.
    fn tried(&self, inputs: &[Slot], ctx: &Context) -> (Tried, Option<Duration>) {
        let judged = |error: &crate::NodeError| match sensible(error) {
            Ok(()) => Tried::Refused(error.to_string()),
            Err(why) => Tried::Broke(why),
        };
        let demanded = match self.demanded(inputs) {
            Ok(Ok(demanded)) => demanded,
            Ok(Err(error)) => return (judged(&error), None),
            Err(why) => return (Tried::Broke(why), None),
        };
        let started = Instant::now();
        let run = self.run(demanded, &self.want(|_| true), ctx);
        let spent = Some(started.elapsed());
        let outputs = match run {
            Ok(outputs) => outputs,
            Err(error) => return (judged(&error), spent),
        };
        let mut answer = Vec::new();
        for (port, value) in self.spec.outputs.iter().zip(outputs) {
            match value {
                None => {
                    return (
                        Tried::Broke(format!("does not give `{}`, which is wanted", port.name)),
                        spent,
                    );
                }
                Some(value) => {
                    if let Err(flaw) = sound(&value) {
                        return (Tried::Broke(format!("`{}` {flaw}", port.name)), spent);
                    }
                    answer.push((port.name, value));
                }
            }
        }
        (Tried::Answered(answer), spent)
    }

    /// Its parameters, defaults filled in.
    pub fn params(&self) -> ParamValues {
        self.node.params()
    }

    /// The node's name, and the method it runs with if that is not the default; in a graph its id.
    pub fn title(&self) -> &str {
        &self.title
    }
}

/// Makes all inputs go with that of the port `anchor` ([`crate::Value::matched`]), as they do in a graph: a mask gets the
/// size of its picture.
pub fn fit(inputs: &mut [Slot], anchor: usize) {
    for other in (0..inputs.len()).filter(|&other| other != anchor) {
        cases::agree(inputs, anchor, other);
    }
}
