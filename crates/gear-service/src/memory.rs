//! Answers of a run that is not finished: what was paid for is not asked for again after an interruption.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use gear_graph::Context;

/// The answers that a node has so far, by name. They are kept with the run's unfinished state, one write an answer, and
/// go when the node is done.
pub struct Memory<'a> {
    ctx: &'a Context,
    answers: Mutex<BTreeMap<String, Vec<u8>>>,
}

impl<'a> Memory<'a> {
    /// What an interrupted run of the same node on the same inputs had already.
    pub fn open(ctx: &'a Context) -> Self {
        let kept = ctx.unfinished().and_then(|bytes| unpack(&bytes)).unwrap_or_default();
        Self {
            ctx,
            answers: Mutex::new(kept),
        }
    }

    /// An answer. It comes from a file: whoever reads it checks it.
    pub fn get(&self, name: &str) -> Option<Vec<u8>> {
        self.answers().get(name).cloned()
    }

    /// Keeps an answer.
    pub fn keep(&self, name: &str, answer: Vec<u8>) {
        let mut answers = self.answers();
        answers.insert(name.to_owned(), answer);
        self.ctx.keep_unfinished_now(&pack(&answers));
    }

    fn answers(&self) -> MutexGuard<'_, BTreeMap<String, Vec<u8>>> {
        self.answers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Names and answers in turn, each after its length.
fn pack(answers: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (name, answer) in answers {
        for part in [name.as_bytes(), answer] {
            bytes.extend_from_slice(&(part.len() as u64).to_le_bytes());
            bytes.extend_from_slice(part);
        }
    }
    bytes
}

fn unpack(mut bytes: &[u8]) -> Option<BTreeMap<String, Vec<u8>>> {
    let mut part = || {
        let (length, rest) = bytes.split_first_chunk::<8>()?;
        let (part, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        bytes = rest;
        Some(part.to_vec())
    };
    let mut answers = BTreeMap::new();
    while let Some(name) = part() {
        answers.insert(String::from_utf8(name).ok()?, part()?);
    }
    Some(answers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_unpacked_as_they_were_packed() {
        let answers = BTreeMap::from([("a".to_owned(), vec![1, 2]), ("b c".to_owned(), Vec::new())]);
        assert_eq!(unpack(&pack(&answers)), Some(answers));
        assert_eq!(unpack(&[255; 40]), Some(BTreeMap::new()));
        let cut = pack(&BTreeMap::from([("a".to_owned(), vec![1, 2])]));
        assert_eq!(unpack(&cut[..cut.len() - 1]), None);
    }
}
