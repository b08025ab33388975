//! What a running node may use besides its inputs.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::unfinished::{Keeping, Unfinished};
use crate::{NodeError, Resources};

/// How far a node has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Share done, 0 to 1.
    pub fraction: f64,
    /// A short remark, such as `loss 0.0123`; may be empty.
    pub message: String,
}

type Listener = dyn Fn(Progress) + Send + Sync;
type Pulse = dyn Fn() + Send + Sync;

/// What a running node may use besides its inputs: progress, interruption, notes. Cheap to clone and to share with
/// other threads. `tracing` events of a node land in the span of its run.
#[derive(Clone)]
pub struct Context {
    cancelled: Arc<AtomicBool>,
    listener: Option<Arc<Listener>>,
    notes: Arc<Mutex<Vec<String>>>,
    seed: u64,
    resources: Resources,
    /// Called whenever the node shows that it is alive.
    pulse: Option<Arc<Pulse>>,
    unfinished: Option<Keeping>,
}

impl Context {
    /// A context that nobody listens to, for tests and for use outside a graph.
    pub fn detached() -> Self {
        Self::new(Arc::new(AtomicBool::new(false)), None, 0)
    }

    /// A context whose run is interrupted when `cancelled` becomes true, and whose progress goes to `listener`.
    pub fn new(cancelled: Arc<AtomicBool>, listener: Option<Arc<Listener>>, seed: u64) -> Self {
        Self {
            cancelled,
            listener,
            notes: Arc::default(),
            seed,
            resources: Resources::default(),
            pulse: None,
            unfinished: None,
        }
    }

    /// The same context with what a run lends.
    pub fn with_resources(self, resources: Resources) -> Self {
        Self { resources, ..self }
    }

    /// The same context with something to do now and then on the node's own threads: it must be quick.
    pub(crate) fn with_pulse(self, pulse: Arc<Pulse>) -> Self {
        Self {
            pulse: Some(pulse),
            ..self
        }
    }

    /// What the run lends.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// The same context with a place for the state of an unfinished action, which is written at most once in `every`.
    pub fn with_unfinished(self, place: Arc<dyn Unfinished>, every: Duration) -> Self {
        Self {
            unfinished: Some(Keeping::new(place, every)),
            ..self
        }
    }

    /// What [`Context::keep_unfinished`] kept last in an earlier run of this very action (the same node, version,
    /// parameters and inputs) that did not end.
    pub fn unfinished(&self) -> Option<Vec<u8>> {
        self.unfinished.as_ref()?.last()
    }

    /// Keeps the state of this action, for a later run of it if this one is interrupted. `state` is asked for only every
    /// few seconds. A node that goes on from a state must give the same bits as one that was never interrupted.
    pub fn keep_unfinished(&self, state: &dyn Fn() -> Vec<u8>) {
        if let Some(unfinished) = &self.unfinished {
            unfinished.keep(state);
        }
    }

    /// The same at once, for what must not be lost: an answer that was paid for.
    pub fn keep_unfinished_now(&self, state: &[u8]) {
        if let Some(unfinished) = &self.unfinished {
            unfinished.keep_now(state);
        }
    }

    /// The action is done.
    pub(crate) fn forget_unfinished(&self) {
        if let Some(unfinished) = &self.unfinished {
            unfinished.forget();
        }
    }

    /// Reports progress: the share done (0 to 1).
    pub fn progress(&self, fraction: f64) {
        self.progress_with(fraction, "");
    }

    /// Reports progress with a short remark, such as the loss.
    pub fn progress_with(&self, fraction: f64, message: impl Into<String>) {
        self.beat();
        if let Some(listener) = &self.listener {
            listener(Progress {
                fraction: fraction.clamp(0.0, 1.0),
                message: message.into(),
            });
        }
    }

    /// Returns [`NodeError::Cancelled`] once the run is interrupted. A node that takes long asks at least every
    /// half second, and hands the error on.
    pub fn checkpoint(&self) -> Result<(), NodeError> {
        self.beat();
        if self.is_cancelled() {
            Err(NodeError::Cancelled)
        } else {
            Ok(())
        }
    }

    fn beat(&self) {
        if let Some(pulse) = &self.pulse {
            pulse();
        }
    }

    /// Whether the run is interrupted.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Leaves a note for the user, such as `3 pixels were not finite and became black`. Notes are kept with the
    /// result and shown again when it comes from the store, so they must be as deterministic as the result.
    pub fn note(&self, note: impl Into<String>) {
        self.notes
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .push(note.into());
    }

    /// The notes left so far.
    pub fn notes(&self) -> Vec<String> {
        self.notes
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .clone()
    }

    /// A seed that depends on the node's type and parameters only, for counter-based random numbers.
    pub fn seed(&self) -> u64 {
        self.seed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::InMemory;

    #[test]
    fn an_interrupted_context_stops_at_the_next_checkpoint() {
        let flag = Arc::new(AtomicBool::new(false));
        let ctx = Context::new(Arc::clone(&flag), None, 0);
        assert!(ctx.checkpoint().is_ok());
        flag.store(true, Ordering::Relaxed);
        assert!(matches!(ctx.checkpoint(), Err(NodeError::Cancelled)));
    }

    #[test]
    fn a_state_is_kept_until_the_action_is_done_and_not_too_often() {
        let place = Arc::new(InMemory::default());
        let ctx = |every| Context::detached().with_unfinished(Arc::clone(&place) as Arc<dyn Unfinished>, every);
        let patient = ctx(Duration::from_secs(3600));
        patient.keep_unfinished(&|| panic!("it is too early to keep anything"));
        let eager = ctx(Duration::ZERO);
        eager.keep_unfinished(&|| vec![1, 2]);
        assert_eq!(patient.unfinished(), Some(vec![1, 2]));
        patient.keep_unfinished_now(&[3]);
        assert_eq!(eager.unfinished(), Some(vec![3]));
        eager.forget_unfinished();
        assert_eq!(ctx(Duration::ZERO).unfinished(), None);
        assert_eq!(Context::detached().unfinished(), None);
    }

    #[test]
    fn progress_stays_between_zero_and_one() {
        let seen = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&seen);
        let listener: Arc<Listener> = Arc::new(move |p: Progress| sink.lock().unwrap().push(p.fraction));
        let ctx = Context::new(Arc::default(), Some(listener), 0);
        ctx.progress(-1.0);
        ctx.progress_with(7.0, "done");
        assert_eq!(*seen.lock().unwrap(), [0.0, 1.0]);
    }
}
