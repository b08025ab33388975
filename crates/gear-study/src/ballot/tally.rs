//! Answers → shares.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{BallotError, EXPERTISE, Key, QUESTIONS};
use crate::random::Random;

/// Draws of the bootstrap over persons: the 2.5 % and 97.5 % points are then good to about one percent point.
const DRAWS: usize = 2000;

/// The 97.5 % point of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// What a participant saved.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Answers {
    /// The version.
    pub ballot_answers: u32,
    /// The ballot.
    pub ballot: String,
    /// How they call themselves.
    pub participant: String,
    /// The group, one of [`EXPERTISE`].
    pub expertise: String,
    /// The sheet that they saw.
    pub sheet: usize,
    /// What they said.
    pub answers: Vec<Answer>,
}

/// One answer.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Answer {
    /// The question's short name.
    pub question: String,
    /// The token that was chosen; none if they cannot tell.
    pub choice: Option<String>,
    /// The place at which it stood, from 0.
    #[serde(default)]
    pub place: Option<usize>,
}

/// Both ends of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// A method's share of the votes on a question in a group.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The question.
    pub question: String,
    /// `all`, `tradition NAME` or `expertise NAME`.
    pub group: String,
    /// The method.
    pub method: String,
    /// Votes for it.
    pub votes: usize,
    /// All votes.
    pub of: usize,
    /// How often people could not tell; none by tradition, as who chooses nothing chooses no token that would tell it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub undecided: Option<usize>,
    /// Persons who voted.
    pub persons: usize,
    /// The share, 0 to 1.
    pub share: f64,
    /// Wilson's interval at 95 %, as if votes were independent.
    pub wilson: Interval,
    /// Of a bootstrap over persons at 95 %; none with fewer than five.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<Interval>,
}

/// The count of a ballot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tally {
    /// The ballot.
    pub ballot: String,
    /// Participants.
    pub persons: usize,
    /// Shares, by question, group and method.
    pub shares: Vec<Share>,
    /// How often what stood at each place was chosen: a place that wins says that something is wrong.
    pub places: Vec<usize>,
    /// What is odd.
    pub notes: Vec<String>,
}

/// A vote or an abstention, unblinded.
struct Vote {
    person: usize,
    question: String,
    tradition: String,
    expertise: String,
    method: Option<String>,
}

/// Counts answer files.
pub fn tally(key: &Key, files: &[(PathBuf, Answers)]) -> Result<Tally, BallotError> {
    let mut notes = Vec::new();
    // The last file of a person counts: who votes again has changed their mind.
    let mut persons: BTreeMap<&str, &(PathBuf, Answers)> = BTreeMap::new();
    for entry in files {
        let (file, answers) = entry;
        if answers.ballot != key.ballot {
            return Err(BallotError::Foreign {
                file: file.clone(),
                found: answers.ballot.clone(),
                expected: key.ballot.clone(),
            });
        }
        if persons.insert(&answers.participant, entry).is_some() {
            notes.push(format!(
                "`{}` answered more than once; the last file counts",
                answers.participant
            ));
        }
    }
    let mut votes = Vec::new();
    let mut places = vec![0; key.methods.len()];
    for (person, (file, answers)) in persons.values().enumerate() {
        for answer in &answers.answers {
            let Some(token) = &answer.choice else {
                votes.push(Vote {
                    person,
                    question: answer.question.clone(),
                    tradition: String::new(),
                    expertise: answers.expertise.clone(),
                    method: None,
                });
                continue;
            };
            let meaning = key.tokens.get(token).ok_or_else(|| BallotError::Token {
                file: file.clone(),
                token: token.clone(),
            })?;
            if let Some(place) = answer.place.and_then(|place| places.get_mut(place)) {
                *place += 1;
            }
            votes.push(Vote {
                person,
                question: answer.question.clone(),
                tradition: meaning.tradition.clone(),
                expertise: answers.expertise.clone(),
                method: Some(meaning.method.clone()),
            });
        }
    }
    let shares = shares(key, &votes, persons.len());
    Ok(Tally {
        ballot: key.ballot.clone(),
        persons: persons.len(),
        shares,
        places,
        notes,
    })
}

/// Whether a vote belongs to a group.
type Holds<'v> = Box<dyn Fn(&Vote) -> bool + 'v>;

fn shares(key: &Key, votes: &[Vote], persons: usize) -> Vec<Share> {
    let traditions: BTreeSet<&str> = key
        .tokens
        .values()
        .map(|m| m.tradition.as_str())
        .filter(|t| !t.is_empty())
        .collect();
    let mut expertise: BTreeSet<&str> = votes.iter().map(|vote| vote.expertise.as_str()).collect();
    let mut groups: Vec<(String, Holds<'_>)> = vec![("all".to_owned(), Box::new(|_| true))];
    for tradition in traditions {
        groups.push((
            format!("tradition {tradition}"),
            Box::new(move |vote| vote.tradition == tradition),
        ));
    }
    // In the order of the page, then whatever else the files say.
    let mut known: Vec<&str> = EXPERTISE
        .iter()
        .map(|(name, _)| *name)
        .filter(|name| expertise.remove(name))
        .collect();
    known.extend(expertise);
    for name in known {
        groups.push((
            format!("expertise {name}"),
            Box::new(move |vote| vote.expertise == name),
        ));
    }
    let mut out = Vec::new();
    for (question, _) in QUESTIONS {
        for (group, holds) in &groups {
            let chosen: Vec<&Vote> = votes.iter().filter(|v| v.question == question && holds(v)).collect();
            let decided: Vec<(usize, &str)> = chosen
                .iter()
                .filter_map(|v| Some((v.person, v.method.as_deref()?)))
                .collect();
            if decided.is_empty() {
                continue;
            }
            let voters: BTreeSet<usize> = decided.iter().map(|(person, _)| *person).collect();
            let spread = bootstrap(&decided, &key.methods, persons, key.seed);
            for (i, method) in key.methods.iter().enumerate() {
                let for_it = decided.iter().filter(|(_, m)| m == method).count();
                out.push(Share {
                    question: question.to_owned(),
                    group: group.clone(),
                    method: method.clone(),
                    votes: for_it,
                    of: decided.len(),
                    undecided: (!group.starts_with("tradition ")).then(|| chosen.len() - decided.len()),
                    persons: voters.len(),
                    share: for_it as f64 / decided.len() as f64,
                    wilson: wilson(for_it, decided.len()),
                    bootstrap: (voters.len() >= 5).then(|| spread[i]),
                });
            }
        }
    }
    out
}

/// Wilson's interval of a share (Wilson 1927): unlike the share ± two standard errors it stays within 0 and 1, and is
/// not empty where nobody or everybody voted so.
fn wilson(votes: usize, of: usize) -> Interval {
    let (n, p) = (of as f64, votes as f64 / of as f64);
    let middle = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    Interval {
        low: (middle - half).max(0.0),
        high: (middle + half).min(1.0),
    }
}

/// Intervals of every method's share when persons are drawn again with replacement.
fn bootstrap(decided: &[(usize, &str)], methods: &[String], persons: usize, seed: u64) -> Vec<Interval> {
    // Votes of each person for each method.
    let mut counts = vec![vec![0usize; methods.len()]; persons];
    for (person, method) in decided {
        if let Some(i) = methods.iter().position(|m| m == method) {
            counts[*person][i] += 1;
        }
    }
    let voters: Vec<_> = counts.into_iter().filter(|of| of.iter().any(|&n| n > 0)).collect();
    let mut random = Random::new(seed ^ 0x07a1_11e5);
    let mut drawn: Vec<Vec<f64>> = vec![Vec::with_capacity(DRAWS); methods.len()];
    for _ in 0..DRAWS {
        let mut sums = vec![0usize; methods.len()];
        for _ in 0..voters.len() {
            let voter = &voters[random.below(voters.len())];
            sums.iter_mut().zip(voter).for_each(|(sum, n)| *sum += n);
        }
        let all: usize = sums.iter().sum();
        for (drawn, sum) in drawn.iter_mut().zip(sums) {
            drawn.push(sum as f64 / all.max(1) as f64);
        }
    }
    drawn
        .into_iter()
        .map(|mut shares| {
            shares.sort_by(f64::total_cmp);
            let at = |q: f64| shares[((q * (DRAWS - 1) as f64).round() as usize).min(DRAWS - 1)];
            Interval {
                low: at(0.025),
                high: at(0.975),
            }
        })
        .collect()
}

/// `1 person`, `2 persons`.
fn counted(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

impl Tally {
    /// The shares as a table.
    pub fn text(&self) -> String {
        let mut out = format!("ballot {}, {}\n", self.ballot, counted(self.persons, "person"));
        let mut before = (String::new(), String::new());
        for share in &self.shares {
            let now = (share.question.clone(), share.group.clone());
            if now != before {
                let undecided = share
                    .undecided
                    .map(|n| format!(", {n} could not tell"))
                    .unwrap_or_default();
                out.push_str(&format!(
                    "\n{}, {}: {} of {}{undecided}\n",
                    share.question,
                    share.group,
                    counted(share.of, "vote"),
                    counted(share.persons, "person")
                ));
                before = now;
            }
            let percent = |i: &Interval| format!("{:5.1} … {:5.1} %", 100.0 * i.low, 100.0 * i.high);
            let spread = share
                .bootstrap
                .as_ref()
                .map_or_else(|| "too few persons".to_owned(), percent);
            out.push_str(&format!(
                "  {:<24} {:5.1} %  ({:>4})  Wilson {}   over persons {spread}\n",
                share.method,
                100.0 * share.share,
                share.votes,
                percent(&share.wilson)
            ));
        }
        let places: Vec<_> = self.places.iter().map(ToString::to_string).collect();
        out.push_str(&format!("\nchosen from left to right: {}\n", places.join(", ")));
        for note in &self.notes {
            out.push_str(&format!("note: {note}\n"));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of R: binom::binom.confint(x, n, methods = "wilson").
    #[test]
    fn wilson_s_interval_is_that_of_the_literature() {
        for (votes, of, low, high) in [
            (0, 10, 0.0, 0.277_532_8),
            (10, 10, 0.722_467_2, 1.0),
            (5, 10, 0.236_593_1, 0.763_406_9),
            (81, 263, 0.255_289_7, 0.366_182_3),
        ] {
            let found = wilson(votes, of);
            assert!(
                (found.low - low).abs() < 2e-4 && (found.high - high).abs() < 2e-4,
                "{votes}/{of}: {found:?}"
            );
        }
    }

    #[test]
    fn a_bootstrap_over_persons_is_wider_than_wilson_where_persons_agree_with_themselves() {
        let methods = ["a".to_owned(), "b".to_owned()];
        // Ten persons with twenty votes each, each always for the same method.
        let votes: Vec<(usize, &str)> = (0..200).map(|i| (i / 20, if i / 20 < 5 { "a" } else { "b" })).collect();
        let spread = bootstrap(&votes, &methods, 10, 1);
        let independent = wilson(100, 200);
        assert!(spread[0].high - spread[0].low > 2.0 * (independent.high - independent.low));
        assert_eq!(spread, bootstrap(&votes, &methods, 10, 1));
    }
}
