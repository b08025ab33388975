//! How many requests are out at a time, and when a server wants the next one.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::ServiceError;

/// How often waiting looks whether the run is interrupted.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// Lets a bounded number through at a time, and nobody before the server's time.
pub struct Pace {
    most: usize,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    out: usize,
    not_before: Option<Instant>,
}

/// A request that is out; dropping it lets the next one through.
pub struct Turn<'a>(&'a Pace);

impl Pace {
    pub fn new(most: usize) -> Self {
        Self {
            most: most.max(1),
            state: Mutex::new(State {
                out: 0,
                not_before: None,
            }),
            changed: Condvar::new(),
        }
    }

    /// Waits for a turn.
    pub fn turn(&self, interrupted: &dyn Fn() -> bool) -> Result<Turn<'_>, ServiceError> {
        let mut state = self.state();
        loop {
            if interrupted() {
                return Err(ServiceError::Interrupted);
            }
            let now = Instant::now();
            let wait = state.not_before.and_then(|time| time.checked_duration_since(now));
            if state.out < self.most && wait.is_none() {
                state.out += 1;
                return Ok(Turn(self));
            }
            let wait = wait.map_or(LOOK, |wait| wait.min(LOOK));
            let waited = self.changed.wait_timeout(state, wait);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Nobody goes before `pause` is over.
    pub fn hold(&self, pause: Duration) {
        let until = Instant::now() + pause;
        let mut state = self.state();
        state.not_before = Some(state.not_before.map_or(until, |time| time.max(until)));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.state().out -= 1;
        self.0.changed.notify_all();
    }
}

/// Waits, and stops when the run is interrupted.
pub fn sleep(pause: Duration, interrupted: &dyn Fn() -> bool) -> Result<(), ServiceError> {
    let end = Instant::now() + pause;
    loop {
        if interrupted() {
            return Err(ServiceError::Interrupted);
        }
        match end.checked_duration_since(Instant::now()) {
            Some(left) if !left.is_zero() => std::thread::sleep(left.min(LOOK)),
            _ => return Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn never_more_than_that_many_are_out() {
        let (pace, out, most) = (Pace::new(2), AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let turn = pace.turn(&|| false).unwrap();
                    most.fetch_max(out.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                    std::thread::sleep(Duration::from_millis(5));
                    out.fetch_sub(1, Ordering::SeqCst);
                    drop(turn);
                });
            }
        });
        assert!(most.into_inner() <= 2);
    }

    #[test]
    fn waiting_ends_when_the_run_is_interrupted() {
        let pace = Pace::new(1);
        pace.hold(Duration::from_secs(3600));
        assert!(matches!(pace.turn(&|| true), Err(ServiceError::Interrupted)));
        assert!(matches!(
            sleep(Duration::from_secs(3600), &|| true),
            Err(ServiceError::Interrupted)
        ));
    }
}
