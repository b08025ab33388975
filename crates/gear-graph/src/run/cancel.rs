//! Interrupting runs.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

type Bell = Box<dyn Fn() + Send>;
type Bells = Arc<Mutex<BTreeMap<u64, Bell>>>;

/// A wish that runs stop, shared by whoever may raise it and by the runs that heed it. It is never taken back.
///
/// A run sleeps until something happens, so raising must wake it. From a bare flag ([`From`]) nobody is woken: the run
/// then looks at it twenty times a second.
#[derive(Clone)]
pub struct Cancel {
    raised: Arc<AtomicBool>,
    /// What to ring when it is raised; none for a bare flag.
    bells: Option<Bells>,
}

impl Cancel {
    /// Nobody wishes it yet.
    pub fn new() -> Self {
        Self {
            raised: Arc::default(),
            bells: Some(Arc::default()),
        }
    }

    /// Wishes it; whether somebody had before. Not for signal handlers: it takes a lock.
    pub fn raise(&self) -> bool {
        let before = self.raised.swap(true, Ordering::SeqCst);
        if let Some(bells) = &self.bells {
            for bell in lock(bells).values() {
                bell();
            }
        }
        before
    }

    /// Whether it was raised.
    pub fn is_raised(&self) -> bool {
        self.raised.load(Ordering::SeqCst)
    }

    /// The flag, for who looks at it now and then.
    pub(crate) fn flag(&self) -> &Arc<AtomicBool> {
        &self.raised
    }

    /// Rings the bell when it is raised, as long as what comes back lives; `None` if nobody would ring.
    pub(crate) fn on_raise(&self, bell: impl Fn() + Send + 'static) -> Option<Listening> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let bells = Arc::clone(self.bells.as_ref()?);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        lock(&bells).insert(number, Box::new(bell));
        Some(Listening { bells, number })
    }
}

impl Default for Cancel {
    fn default() -> Self {
        Self::new()
    }
}

impl From<Arc<AtomicBool>> for Cancel {
    fn from(raised: Arc<AtomicBool>) -> Self {
        Self { raised, bells: None }
    }
}

/// A bell that hangs.
pub(crate) struct Listening {
    bells: Bells,
    number: u64,
}

impl Drop for Listening {
    fn drop(&mut self) {
        lock(&self.bells).remove(&self.number);
    }
}

fn lock(bells: &Bells) -> std::sync::MutexGuard<'_, BTreeMap<u64, Bell>> {
    bells.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_that_listens_is_woken_and_none_after_it_is_done() {
        let cancel = Cancel::new();
        let rung = Arc::new(AtomicU64::new(0));
        let listen = || {
            let rung = Arc::clone(&rung);
            cancel.on_raise(move || {
                rung.fetch_add(1, Ordering::Relaxed);
            })
        };
        let (_one, _two) = (listen(), listen());
        drop(listen());
        assert!(!cancel.is_raised());
        assert!(!cancel.clone().raise());
        assert!(cancel.is_raised() && cancel.raise());
        assert_eq!(rung.load(Ordering::Relaxed), 4);
    }

    #[test]
    fn a_bare_flag_rings_nothing() {
        let flag = Arc::new(AtomicBool::new(false));
        let cancel = Cancel::from(Arc::clone(&flag));
        assert!(cancel.on_raise(|| ()).is_none());
        flag.store(true, Ordering::Relaxed);
        assert!(cancel.is_raised());
    }
}
