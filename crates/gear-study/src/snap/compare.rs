//! How far a value moved.
//!
//! A norm is taken of the raster where there is one; else of each number, and the largest counts. With a before and b
//! after, over n numbers:
//!
//! ```text
//! max        max |a − b|            rms        √(Σ (a − b)² / n)
//! mean       Σ |a − b| / n          relative   √(Σ (a − b)² / Σ a²)
//! ```
//!
//! A pixel that is nothing (NaN) before and after did not move. One that is nothing on one side only has moved without
//! bound for `max`; the other norms take it for a change of 1, so that a rim that shifts by a pixel can be tolerated.

use gear_graph::graph::Norm;
use serde_json::Value as Json;

use super::reduce::Reduced;

/// What became of a value.
#[derive(Clone, Debug, PartialEq)]
pub enum Moved {
    /// By so much, in the norm.
    By(f64),
    /// It is another thing: another size, a text that changed, a number that is gone. With what changed.
    Shape(String),
}

/// A number that moved.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Number {
    /// Its path in the summary or report.
    pub path: String,
    /// Before, as JSON; `null` if it was not there.
    pub before: Json,
    /// After.
    pub after: Json,
}

/// How far `after` is from `before`.
pub fn moved(before: &Reduced, after: &Reduced, norm: Norm) -> Moved {
    match (&before.raster, &after.raster) {
        (Some(a), Some(b)) => {
            if a.size() != b.size() || a.numbers().len() != b.numbers().len() {
                let ((aw, ah), (bw, bh)) = (a.size(), b.size());
                return Moved::Shape(format!("{aw}×{ah} became {bw}×{bh}"));
            }
            let pairs = a.numbers().iter().zip(b.numbers());
            Moved::By(distance(pairs.map(|(&a, &b)| (f64::from(a), f64::from(b))), norm))
        }
        (None, None) => {
            let mut worst = 0.0;
            for number in numbers(&before.numbers, &after.numbers) {
                match (number.before.as_f64(), number.after.as_f64()) {
                    (Some(a), Some(b)) => worst = f64::max(worst, distance([(a, b)].into_iter(), norm)),
                    _ => return Moved::Shape(format!("`{}`: {} became {}", number.path, number.before, number.after)),
                }
            }
            Moved::By(worst)
        }
        (Some(_), None) => Moved::Shape("there is no picture any more".to_owned()),
        (None, Some(_)) => Moved::Shape("there was no picture".to_owned()),
    }
}

fn distance(pairs: impl Iterator<Item = (f64, f64)>, norm: Norm) -> f64 {
    let (mut count, mut most, mut sum, mut squares, mut size) = (0.0f64, 0.0f64, 0.0, 0.0, 0.0);
    for (a, b) in pairs {
        count += 1.0;
        let off = match (a.is_finite(), b.is_finite()) {
            (true, true) => (a - b).abs(),
            _ if a == b || (a.is_nan() && b.is_nan()) => 0.0,
            _ => {
                most = f64::INFINITY;
                1.0
            }
        };
        most = most.max(off);
        sum += off;
        squares += off * off;
        size += if a.is_finite() { a * a } else { 0.0 };
    }
    let count = count.max(1.0);
    match norm {
        Norm::Max => most,
        Norm::Mean => sum / count,
        Norm::Rms => (squares / count).sqrt(),
        Norm::Relative if squares == 0.0 => 0.0,
        Norm::Relative => (squares / size).sqrt(),
    }
}

/// The leaves in which two JSON values differ, in the order of the first.
pub fn numbers(before: &Json, after: &Json) -> Vec<Number> {
    let (mut a, mut b) = (Vec::new(), Vec::new());
    leaves("", before, &mut a);
    leaves("", after, &mut b);
    let find = |in_: &[(String, Json)], path: &str| in_.iter().find(|(p, _)| p == path).map(|(_, v)| v.clone());
    let mut out = Vec::new();
    for (path, before) in &a {
        let after = find(&b, path).unwrap_or_default();
        if *before != after {
            out.push(Number {
                path: path.clone(),
                before: before.clone(),
                after,
            });
        }
    }
    for (path, after) in &b {
        if find(&a, path).is_none() {
            out.push(Number {
                path: path.clone(),
                before: Json::Null,
                after: after.clone(),
            });
        }
    }
    out
}

fn leaves(path: &str, json: &Json, out: &mut Vec<(String, Json)>) {
    let below = |key: &str| {
        if path.is_empty() {
            key.to_owned()
        } else {
            format!("{path}.{key}")
        }
    };
    match json {
        Json::Object(entries) => entries.iter().for_each(|(key, value)| leaves(&below(key), value, out)),
        Json::Array(items) => {
            let items = items.iter().enumerate();
            items.for_each(|(i, value)| leaves(&below(&i.to_string()), value, out));
        }
        leaf => out.push((if path.is_empty() { "value" } else { path }.to_owned(), leaf.clone())),
    }
}

#[cfg(test)]
mod tests {
    use gear_image::Field;
    use serde_json::json;

    use super::*;
    use crate::snap::reduce::Raster;

    fn field(numbers: &[f32]) -> Reduced {
        Reduced {
            raster: Some(Raster::Numbers(Field::from_vec(numbers.len(), 1, numbers.to_vec()))),
            numbers: Json::Null,
        }
    }

    fn report(numbers: Json) -> Reduced {
        Reduced { raster: None, numbers }
    }

    fn by(before: &Reduced, after: &Reduced, norm: Norm) -> f64 {
        match moved(before, after, norm) {
            Moved::By(distance) => distance,
            Moved::Shape(why) => panic!("{why}"),
        }
    }

    #[test]
    fn each_norm_is_its_formula() {
        let (a, b) = (field(&[3.0, 4.0, 0.0, 0.0]), field(&[3.0, 4.0, 3.0, -1.0]));
        assert_eq!(by(&a, &b, Norm::Max), 3.0);
        assert_eq!(by(&a, &b, Norm::Mean), 1.0);
        assert_eq!(by(&a, &b, Norm::Rms), 2.5f64.sqrt());
        assert_eq!(by(&a, &b, Norm::Relative), 0.4f64.sqrt());
        for norm in Norm::ALL {
            assert_eq!(by(&a, &a, norm), 0.0);
        }
        assert_eq!(by(&field(&[0.0]), &field(&[1.0]), Norm::Relative), f64::INFINITY);
    }

    #[test]
    fn nothing_on_both_sides_did_not_move() {
        let (a, b) = (field(&[f32::NAN, 1.0]), field(&[f32::NAN, 1.0]));
        assert_eq!(by(&a, &b, Norm::Max), 0.0);
        let c = field(&[0.5, 1.0]);
        assert_eq!(by(&a, &c, Norm::Max), f64::INFINITY);
        assert_eq!(by(&a, &c, Norm::Mean), 0.5);
    }

    #[test]
    fn of_a_report_the_number_that_moved_most_counts_and_a_text_is_a_shape() {
        let a = report(json!({"a": 1.0, "b": {"c": [2.0, "x"]}}));
        assert_eq!(
            by(&a, &report(json!({"a": 1.5, "b": {"c": [4.0, "x"]}})), Norm::Max),
            2.0
        );
        for other in [
            json!({"a": 1.0}),
            json!({"a": 1.0, "b": {"c": [2.0, "y"]}}),
            json!(null),
        ] {
            assert!(matches!(moved(&a, &report(other), Norm::Max), Moved::Shape(_)));
        }
        assert!(matches!(
            moved(&field(&[1.0]), &field(&[1.0, 2.0]), Norm::Rms),
            Moved::Shape(_)
        ));
    }
}
