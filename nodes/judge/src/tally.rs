//! From votes to the report.

use serde_json::{Value, json};

/// The dimensions of the paper's Table 2.
pub const DIMENSIONS: [&str; 4] = ["TF", "GA", "VC", "AC"];

/// What candidates are called.
pub const LETTERS: [&str; 12] = ["A", "B", "C", "D", "E", "F", "G", "H", "I", "J", "K", "L"];

/// One vote.
#[derive(Clone, Debug)]
pub struct Vote {
    /// The method at every place.
    order: Vec<usize>,
    /// Scores by place.
    placed: Vec<[f64; 4]>,
    /// The model that the answer names.
    model: Option<String>,
}

impl Vote {
    pub fn new(order: Vec<usize>, placed: Vec<[f64; 4]>, model: Option<String>) -> Self {
        Self { order, placed, model }
    }

    fn of_method(&self, method: usize) -> [f64; 4] {
        let place = self.order.iter().position(|m| *m == method);
        place.map_or([f64::NAN; 4], |place| self.placed[place])
    }
}

/// What the votes say.
pub fn report(names: &[String], votes: &[Vote], asked: &str) -> Value {
    let methods: Vec<Value> = names
        .iter()
        .enumerate()
        .map(|(i, name)| method(name, i, votes))
        .collect();
    let told: Vec<Value> = votes
        .iter()
        .map(|vote| {
            let order: Vec<&String> = vote.order.iter().map(|method| &names[*method]).collect();
            json!({"order": order, "scores": vote.placed, "answered": vote.model})
        })
        .collect();
    json!({
        "asked": asked,
        "dimensions": DIMENSIONS,
        "methods": methods,
        "agreement": agreement(names.len(), votes),
        "position_bias": position_bias(names.len(), votes),
        "votes": told,
    })
}

fn method(name: &str, index: usize, votes: &[Vote]) -> Value {
    let scores: Vec<[f64; 4]> = votes.iter().map(|vote| vote.of_method(index)).collect();
    let mut entry = serde_json::Map::new();
    entry.insert("name".to_owned(), name.into());
    for (d, dimension) in DIMENSIONS.iter().enumerate() {
        let column: Vec<f64> = scores.iter().map(|row| row[d]).collect();
        entry.insert(
            (*dimension).to_owned(),
            json!({"mean": mean(&column), "spread": spread(&column)}),
        );
    }
    let means: Vec<f64> = scores.iter().map(|row| mean(row)).collect();
    entry.insert("mean".to_owned(), mean(&means).into());
    Value::Object(entry)
}

fn mean(xs: &[f64]) -> f64 {
    xs.iter().sum::<f64>() / xs.len().max(1) as f64
}

/// Standard deviation of a sample; `null` for one vote.
fn spread(xs: &[f64]) -> Option<f64> {
    let mean = mean(xs);
    let squares: f64 = xs.iter().map(|x| (x - mean) * (x - mean)).sum();
    (xs.len() > 1).then(|| (squares / (xs.len() - 1) as f64).sqrt())
}

/// Mean rank correlation (Spearman's, ties at their mean rank) of the methods' mean scores in two votes; `null` if there
/// are no two votes that tell methods apart.
fn agreement(methods: usize, votes: &[Vote]) -> Option<f64> {
    let ranks: Vec<Vec<f64>> = votes
        .iter()
        .map(|vote| ranks(&(0..methods).map(|m| mean(&vote.of_method(m))).collect::<Vec<_>>()))
        .collect();
    let mut found = Vec::new();
    for i in 0..ranks.len() {
        for j in 0..i {
            found.extend(correlation(&ranks[i], &ranks[j]));
        }
    }
    (!found.is_empty()).then(|| mean(&found))
}

fn ranks(scores: &[f64]) -> Vec<f64> {
    let below = |x: f64| scores.iter().filter(|y| **y < x).count() as f64;
    let equal = |x: f64| scores.iter().filter(|y| **y == x).count() as f64;
    scores.iter().map(|x| below(*x) + (equal(*x) + 1.0) / 2.0).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(a, b)| f(a - mean_a, b - mean_b)).sum::<f64>();
    let scale = (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt();
    (scale > 0.0).then(|| sum(&|a, b| a * b) / scale)
}

/// Mean score of every place less the mean of all: what standing there was worth. Only whole squares of votes count,
/// in which every method stood in every place.
fn position_bias(methods: usize, votes: &[Vote]) -> Option<Value> {
    let whole = votes.len() / methods * methods;
    let votes = &votes[..whole];
    if votes.is_empty() {
        return None;
    }
    let of_place = |place: usize| mean(&votes.iter().map(|vote| mean(&vote.placed[place])).collect::<Vec<_>>());
    let places: Vec<f64> = (0..methods).map(of_place).collect();
    let all = mean(&places);
    let bias: Vec<f64> = places.iter().map(|place| place - all).collect();
    let largest = bias.iter().fold(0.0f64, |most, b| most.max(b.abs()));
    Some(json!({"by_place": bias, "largest": largest}))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::votes::order;

    /// Votes of a judge with these scores for methods, and a bonus for the first place.
    fn votes(methods: &[f64], bonus: f64, count: u32) -> Vec<Vote> {
        let vote = |number| {
            let order = order(methods.len(), number, 1);
            let placed = order
                .iter()
                .enumerate()
                .map(|(place, m)| [methods[*m] + if place == 0 { bonus } else { 0.0 }; 4]);
            let placed = placed.collect();
            Vote::new(order, placed, None)
        };
        (0..count).map(vote).collect()
    }

    #[test]
    fn a_fair_judge_agrees_with_himself_and_has_no_bias() {
        let names = ["raw", "ours", "other"].map(str::to_owned);
        let report = report(&names, &votes(&[3.0, 8.0, 5.0], 0.0, 6), "service:m");
        assert_eq!(report["methods"][1]["TF"], json!({"mean": 8.0, "spread": 0.0}));
        assert!((report["agreement"].as_f64().unwrap() - 1.0).abs() < 1e-12);
        assert!(report["position_bias"]["largest"].as_f64().unwrap() < 1e-12);
    }

    #[test]
    fn a_judge_who_prefers_the_first_is_found_out() {
        let bias = position_bias(3, &votes(&[3.0, 8.0, 5.0], 3.0, 6)).unwrap();
        assert!((bias["by_place"][0].as_f64().unwrap() - 2.0).abs() < 1e-12, "{bias}");
        assert_eq!(
            position_bias(3, &votes(&[3.0, 8.0, 5.0], 3.0, 2)),
            None,
            "no whole square"
        );
    }

    #[test]
    fn ties_stand_at_their_mean_rank() {
        assert_eq!(ranks(&[2.0, 1.0, 2.0]), [2.5, 1.0, 2.5]);
        assert_eq!(correlation(&[1.0, 1.0], &[1.0, 2.0]), None);
    }
}
