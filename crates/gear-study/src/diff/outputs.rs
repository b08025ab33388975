//! How far apart the outputs of two runs are.
//!
//! A value comes from the store of its run, by its digest, or from the files of the output folder where these are exact
//! (fields, scenes, reports, numbers). Pictures in the folder are rounded to 8 bits and serve when the store has lost
//! the value; the comparison says so.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gear_graph::{AnyValue, Digest, Registry, Store};
use gear_image::io::{Options, read_image};
use serde::Serialize;

use super::record::{OutputRecord, Record};
use crate::norms::{between, numbers};

/// An output in both runs.
#[derive(Clone, Debug, Default, Serialize)]
pub struct OutputDifference {
    /// Its name.
    pub name: String,
    /// The type of its value.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Whether its value is the same in both runs, to the last bit.
    pub same: bool,
    /// The norms of the difference: name and value.
    pub norms: Vec<(String, f64)>,
    /// The numbers in it that differ: place, in the one, in the other. Those that differ by most of themselves come
    /// first, those that one run lacks last.
    pub numbers: Vec<(String, Option<f64>, Option<f64>)>,
    /// What else is to be said, such as that one run has no such output.
    pub remark: String,
}

/// Where values are found.
pub struct Values<'v> {
    registry: &'v Registry,
    stores: [Option<Store>; 2],
    folders: [PathBuf; 2],
}

impl<'v> Values<'v> {
    /// The values of two runs: from `store`, or else the stores that their records name, and from their folders.
    pub fn of(a: &Record, b: &Record, store: Option<&Path>, registry: &'v Registry) -> Self {
        let open = |record: &Record| {
            let path = store.map(Path::to_path_buf).or_else(|| record.store.clone())?;
            // Looking makes no store.
            Store::exists(&path).then(|| Store::look_at(path))
        };
        Self {
            registry,
            stores: [open(a), open(b)],
            folders: [a.folder.clone(), b.folder.clone()],
        }
    }

    pub(super) fn difference(&self, name: &str, a: Option<OutputRecord>, b: Option<OutputRecord>) -> OutputDifference {
        let known = a.as_ref().or(b.as_ref());
        let mut difference = OutputDifference {
            name: name.to_owned(),
            type_name: known.map(|output| output.type_name.clone()).unwrap_or_default(),
            ..OutputDifference::default()
        };
        let (a, b) = match (a, b) {
            (Some(a), Some(b)) if !a.digest.is_empty() && !b.digest.is_empty() => (a, b),
            (a, _) => {
                let has = a.is_some_and(|a| !a.digest.is_empty());
                difference.remark = format!("only the {} run has it", if has { "first" } else { "second" });
                return difference;
            }
        };
        difference.same = a.digest == b.digest && a.type_name == b.type_name;
        if difference.same {
            return difference;
        }
        let (Some((value_a, exact_a)), Some((value_b, exact_b))) = (self.value(0, &a), self.value(1, &b)) else {
            difference.remark = "it differs; the values are neither in the stores nor in the folders".to_owned();
            return difference;
        };
        if !(exact_a && exact_b) {
            difference.remark = "from files of 8 bits; the store has lost the values".to_owned();
        }
        match between(&value_a, &value_b) {
            Ok(distance) => {
                let norms = [
                    ("max", distance.max),
                    ("rms", distance.rms),
                    ("mean", distance.mean),
                    ("rel-l2", distance.relative),
                ];
                difference.norms = norms
                    .into_iter()
                    .map(|(name, value)| (name.to_owned(), value))
                    .collect();
                if distance.unmatched > 0 {
                    difference.remark = format!("{} samples are a number in one run only", distance.unmatched);
                }
            }
            Err(why) => {
                if !matches!(difference.type_name.as_str(), "Report") {
                    difference.remark = why;
                }
                difference.numbers = differing(&value_a, &value_b);
            }
        }
        difference
    }

    /// The value of an output, and whether it is exact.
    fn value(&self, run: usize, output: &OutputRecord) -> Option<(AnyValue, bool)> {
        let value_type = self.registry.find_value(&output.type_name)?;
        let digest = Digest::from_hex(&output.digest)?;
        let stored = self.stores[run]
            .as_ref()
            .and_then(|store| store.load(&digest, &value_type));
        if let Some(value) = stored {
            return Some((value, true));
        }
        let folder = &self.folders[run];
        let file = folder.join(format!("{}.{}", output.name, value_type.extension));
        if let Ok(bytes) = std::fs::read(&file)
            && let Ok(value) = value_type.decode(&bytes)
        {
            return Some((value, true));
        }
        let picture = folder.join(format!("{}.png", output.name));
        let loaded = (output.type_name == "Image").then(|| read_image(&picture, &Options::default()).ok())??;
        Some((AnyValue::new(loaded.image), false))
    }
}

/// The numbers that differ, largest differences first.
fn differing(a: &AnyValue, b: &AnyValue) -> Vec<(String, Option<f64>, Option<f64>)> {
    let of = |value: &AnyValue| -> BTreeMap<String, f64> { numbers(value).into_iter().collect() };
    let (map_a, map_b) = (of(a), of(b));
    let places = numbers(a)
        .into_iter()
        .chain(numbers(b).into_iter().filter(|(place, _)| !map_a.contains_key(place)));
    let all = places.map(|(place, _)| {
        let (a, b) = (map_a.get(&place).copied(), map_b.get(&place).copied());
        (place, a, b)
    });
    let mut all: Vec<_> = all.filter(|(_, a, b)| a != b).collect();
    all.sort_by(|x, y| share(y.1, y.2).total_cmp(&share(x.1, x.2)));
    all
}

/// By how much of the larger one two numbers differ; negative if there is only one.
fn share(a: Option<f64>, b: Option<f64>) -> f64 {
    match (a, b) {
        (Some(a), Some(b)) if a.abs().max(b.abs()) > 0.0 => (b - a).abs() / a.abs().max(b.abs()),
        (Some(_), Some(_)) => 0.0,
        _ => -1.0,
    }
}
