//! States of actions that did not end, as blobs.

use std::sync::Arc;

use super::Store;
use crate::node::Unfinished;
use crate::{Digest, Hasher};

/// The place of one action's state.
pub(crate) struct UnfinishedAction {
    store: Arc<Store>,
    key: Digest,
}

impl UnfinishedAction {
    /// `key`: the action's.
    pub fn new(store: Arc<Store>, key: &Digest) -> Self {
        Self {
            store,
            key: Hasher::new("unfinished").digest(key).finish(),
        }
    }
}

impl Unfinished for UnfinishedAction {
    fn last(&self) -> Option<Vec<u8>> {
        self.store.get_blob(&self.key).filter(|state| !state.is_empty())
    }

    fn keep(&self, state: &[u8]) {
        self.store.replace_blob(&self.key, state);
    }

    fn forget(&self) {
        // Records are not removed; an empty one says that there is nothing.
        self.store.replace_blob(&self.key, &[]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_state_of_an_action_is_kept_and_only_that() {
        let folder = tempfile::tempdir().unwrap();
        let store = Arc::new(Store::open(folder.path()));
        let place = |name: &str| UnfinishedAction::new(Arc::clone(&store), &Digest::of(name.as_bytes()));
        let (one, other) = (place("one"), place("other"));
        let state = |k: u8| vec![k; 10_000];
        for k in 1..4 {
            one.keep(&state(k));
        }
        assert_eq!((one.last(), other.last()), (Some(state(3)), None));
        let files = || {
            let folders = std::fs::read_dir(folder.path().join("contents")).unwrap();
            folders
                .flat_map(|f| std::fs::read_dir(f.unwrap().path()).unwrap())
                .count()
        };
        assert_eq!(files(), 1);
        // Another process finds it.
        let again = Arc::new(Store::open(folder.path()));
        assert_eq!(UnfinishedAction::new(again, &Digest::of(b"one")).last(), Some(state(3)));
        one.forget();
        assert_eq!((one.last(), files()), (None, 0));
    }
}
