//! A place for the state of an unfinished action, in memory.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::Unfinished;

/// Keeps the state of an unfinished action, so that a test can break a node off and let it go on: see
/// [`crate::Context::with_unfinished`].
#[derive(Default)]
pub struct InMemory(Mutex<Option<Vec<u8>>>);

impl InMemory {
    fn state(&self) -> MutexGuard<'_, Option<Vec<u8>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Unfinished for InMemory {
    fn last(&self) -> Option<Vec<u8>> {
        self.state().clone()
    }

    fn keep(&self, state: &[u8]) {
        *self.state() = Some(state.to_vec());
    }

    fn forget(&self) {
        *self.state() = None;
    }
}
