//! What is made from values to be looked at or written: pictures, files. Made once and kept in the store by the digest
//! of the value it came from, so that a second run neither decodes nor encodes anything.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use gear_graph::{Digest, Hasher, Store};

/// Artefacts of this run and, if there is a store, of earlier ones.
pub struct Artefacts {
    store: Option<Arc<Store>>,
    made: Mutex<BTreeMap<Digest, Arc<[u8]>>>,
}

impl Artefacts {
    /// Without a store, artefacts live as long as the run.
    pub fn new(store: Option<Arc<Store>>) -> Self {
        Self {
            store,
            made: Mutex::default(),
        }
    }

    /// The store, if there is one.
    pub fn store(&self) -> Option<&Store> {
        self.store.as_deref()
    }

    /// The artefact of this kind made from the value with this digest; `kind` names the maker and its version.
    pub fn get(&self, kind: &str, of: &Digest) -> Option<Arc<[u8]>> {
        let key = key(kind, of);
        if let Some(bytes) = self.made.lock().unwrap_or_else(PoisonError::into_inner).get(&key) {
            return Some(Arc::clone(bytes));
        }
        self.store.as_ref()?.get_blob(&key).map(Into::into)
    }

    /// Whether there seems to be one; it is verified when it is taken.
    pub fn has(&self, kind: &str, of: &Digest) -> bool {
        let key = key(kind, of);
        let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.contains_key(&key) || self.store.as_ref().is_some_and(|store| store.has_blob(&key))
    }

    /// Keeps an artefact.
    pub fn put(&self, kind: &str, of: &Digest, bytes: Vec<u8>) -> Arc<[u8]> {
        let key = key(kind, of);
        if let Some(store) = &self.store {
            store.put_blob(&key, &bytes);
        }
        let bytes: Arc<[u8]> = bytes.into();
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.insert(key, Arc::clone(&bytes));
        bytes
    }
}

fn key(kind: &str, of: &Digest) -> Digest {
    Hasher::new("artefact").bytes(kind.as_bytes()).digest(of).finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_kind_is_another_artefact() {
        let artefacts = Artefacts::new(None);
        let of = Digest::of(b"value");
        artefacts.put("a", &of, vec![1]);
        assert_eq!(artefacts.get("a", &of).as_deref(), Some(&[1][..]));
        assert_eq!(artefacts.get("b", &of), None);
        assert_eq!(artefacts.get("a", &Digest::of(b"other")), None);
    }

    #[test]
    fn a_later_run_finds_them_in_the_store() {
        let folder = tempfile::tempdir().unwrap();
        let of = Digest::of(b"value");
        Artefacts::new(Some(Arc::new(Store::open(folder.path())))).put("a", &of, vec![9; 10_000]);
        let later = Artefacts::new(Some(Arc::new(Store::open(folder.path()))));
        assert!(later.has("a", &of) && !later.has("b", &of));
        assert_eq!(later.get("a", &of).as_deref(), Some(&[9; 10_000][..]));
    }
}
