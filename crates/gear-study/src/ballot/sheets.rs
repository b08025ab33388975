//! Tokens and orders, all from one seed.

use std::collections::BTreeMap;

use gear_graph::{Digest, Hasher};
use serde::Serialize;

use super::{Case, Key, Meaning, VERSION};
use crate::random::Random;

/// A trial as a participant sees it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Trial {
    /// Its number among the cases, which says nothing.
    pub trial: usize,
    /// Tokens from left to right.
    pub tokens: Vec<String>,
}

/// The trials of a participant, in order.
pub type Sheet = Vec<Trial>;

/// Draws the key and `count` sheets.
pub fn draw(cases: &[Case], methods: &[String], seed: u64, count: usize) -> (Key, Vec<Sheet>) {
    let mut id = Hasher::new("ballot");
    id.u64(seed);
    let mut tokens = BTreeMap::new();
    let mut of_case: Vec<Vec<String>> = Vec::new();
    for case in cases {
        let mut drawn = Vec::new();
        for method in methods {
            id.bytes(case.name.as_bytes()).bytes(method.as_bytes());
            let token = token(seed, &case.name, method);
            let meaning = Meaning {
                case: case.name.clone(),
                tradition: case.tradition.clone(),
                method: method.clone(),
            };
            tokens.insert(token.clone(), meaning);
            drawn.push(token);
        }
        of_case.push(drawn);
    }
    let mut random = Random::new(seed);
    // Which case is which trial is drawn as well: a participant who sees 7 first learns nothing.
    let mut numbers: Vec<usize> = (0..cases.len()).collect();
    random.shuffle(&mut numbers);
    for tokens in &mut of_case {
        random.shuffle(tokens);
    }
    let sheets = (0..count)
        .map(|sheet| {
            let mut trials: Sheet = of_case
                .iter()
                .zip(&numbers)
                .map(|(tokens, &trial)| {
                    let mut tokens = tokens.clone();
                    let turn = sheet % tokens.len().max(1);
                    tokens.rotate_left(turn);
                    Trial { trial, tokens }
                })
                .collect();
            random.shuffle(&mut trials);
            trials
        })
        .collect();
    let key = Key {
        ballot_key: VERSION,
        ballot: short(&id.finish()),
        seed,
        methods: methods.to_vec(),
        tokens,
    };
    (key, sheets)
}

fn token(seed: u64, case: &str, method: &str) -> String {
    let mut hasher = Hasher::new("ballot token");
    hasher.u64(seed).bytes(case.as_bytes()).bytes(method.as_bytes());
    short(&hasher.finish())
}

/// 48 bits: among a million tokens two are the same once in five hundred ballots of that size, and ballots have hundreds.
fn short(digest: &Digest) -> String {
    digest.hex().chars().take(12).collect()
}
