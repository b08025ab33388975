//! What agrees in order with published numbers.
//!
//! Absolute values of two implementations of a measure, on other pictures and behind other networks, say nothing beside
//! each other. What can be asked is whether the variants come in the same order: for every two of them, which one is
//! published as larger, and which one is larger here, case by case.

use super::file::Study;
use super::results::Results;
use crate::stats::Interval;

/// Two variants in one measure, the first published as the larger.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Number of the measure.
    pub measure: usize,
    /// The variant with the larger published number.
    pub larger: usize,
    /// The other one.
    pub smaller: usize,
    /// Our mean difference, larger minus smaller.
    pub difference: f64,
    /// Its interval.
    pub interval: Option<Interval>,
    /// What that means.
    pub verdict: Verdict,
}

/// Whether two variants come in the published order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Yes, and the interval leaves no other sign.
    Agrees,
    /// No, and the interval leaves no other sign.
    Disagrees,
    /// The interval holds 0, or there is none.
    Open,
    /// They are equal here in every case.
    Equal,
}

impl Verdict {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Disagrees => "does not agree",
            Self::Open => "not resolved",
            Self::Equal => "equal here",
        }
    }
}

/// Every two variants that have different published numbers in a measure, by measure.
pub fn compare(study: &Study, results: &Results) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (m, measure) in study.measures.iter().enumerate() {
        let published = |variant: usize| study.variants[variant].paper.get(&measure.name).copied();
        for a in 0..study.variants.len() {
            for b in a + 1..study.variants.len() {
                let (Some(of_a), Some(of_b)) = (published(a), published(b)) else {
                    continue;
                };
                if of_a == of_b {
                    continue;
                }
                let (larger, smaller) = if of_a > of_b { (a, b) } else { (b, a) };
                let Some(paired) = results.paired(study, larger, smaller, m) else {
                    continue;
                };
                let verdict = match paired.interval {
                    _ if paired.larger + paired.smaller == 0 => Verdict::Equal,
                    Some(interval) if interval.excludes_zero() && paired.mean > 0.0 => Verdict::Agrees,
                    Some(interval) if interval.excludes_zero() => Verdict::Disagrees,
                    _ => Verdict::Open,
                };
                pairs.push(Pair {
                    measure: m,
                    larger,
                    smaller,
                    difference: paired.mean,
                    interval: paired.interval,
                    verdict,
                });
            }
        }
    }
    pairs
}
