//! The state of an action that is not finished: what a node that takes long goes on from when it was interrupted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Where the state of one action is kept. The run keeps it in its store, under the action's key, so that what a state
/// is found by says everything that the result depends on.
pub trait Unfinished: Send + Sync {
    /// What was kept last.
    fn last(&self) -> Option<Vec<u8>>;

    /// Keeps this in place of what was kept before.
    fn keep(&self, state: &[u8]);

    /// The action is done: nothing needs to be kept any more.
    fn forget(&self);
}

/// A place, and how often it is written.
#[derive(Clone)]
pub(super) struct Keeping {
    place: Arc<dyn Unfinished>,
    every: Duration,
    last: Arc<Mutex<Instant>>,
    /// Something may be there.
    used: Arc<AtomicBool>,
}

impl Keeping {
    pub fn new(place: Arc<dyn Unfinished>, every: Duration) -> Self {
        Self {
            place,
            every,
            last: Arc::new(Mutex::new(Instant::now())),
            used: Arc::default(),
        }
    }

    pub fn last(&self) -> Option<Vec<u8>> {
        let state = self.place.last();
        self.used.fetch_or(state.is_some(), Ordering::Relaxed);
        state
    }

    pub fn keep(&self, state: &dyn Fn() -> Vec<u8>) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= self.every {
            self.used.store(true, Ordering::Relaxed);
            self.place.keep(&state());
            *last = Instant::now();
        }
    }

    pub fn keep_now(&self, state: &[u8]) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        self.used.store(true, Ordering::Relaxed);
        self.place.keep(state);
        *last = Instant::now();
    }

    pub fn forget(&self) {
        if self.used.swap(false, Ordering::Relaxed) {
            self.place.forget();
        }
    }
}
