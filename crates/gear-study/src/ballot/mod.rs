//! What people prefer: a page to judge on, and the count of what they said.
//!
//! A ballot compares methods on cases (paintings). Each trial shows one painting and, beside each other, what every method
//! made of it, as views that are turned together. People say which has the most convincing depth, which is the most
//! beautiful and which is best over all, or that they cannot tell.
//!
//! *Blinding.* The page knows no method. Each pair of case and method has a token that is drawn from the seed; pictures are
//! encoded anew and stand in the page in the order of their tokens. What tokens mean is written to a key file that stays
//! with whoever made the ballot.
//!
//! *Order.* The page holds a number of sheets; a participant gets the sheet that their name falls on. On a sheet the
//! trials are in random order. Within a trial the methods are in a random order that is rotated from sheet to sheet, so
//! that over as many sheets as there are methods each of them stands in each place once.
//!
//! *Counting.* A method's share is its votes over all votes of the question (who cannot tell does not vote). Intervals are
//! Wilson's at 95 %, and, because votes of one person hang together, those of a bootstrap over persons.
//!
//! | file | what it holds |
//! |---|---|
//! | `collect` | run folders and manifests → cases with pictures |
//! | `study` | results of a study → the same |
//! | `sheets` | tokens and orders |
//! | `page` | the page |
//! | `tally` | answers → shares |

mod collect;
mod page;
mod sheets;
mod study;
mod tally;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use collect::{About, Given, Manifest, from_folders, from_manifest};
pub use page::page;
pub use sheets::{Sheet, Trial, draw};
pub use study::{STUDY, from_study};
pub use tally::{Answers, Interval, Share, Tally, tally};

/// The version of keys and answers.
pub const VERSION: u32 = 1;

/// What is asked of every case: a short name and the question.
pub const QUESTIONS: [(&str, &str); 3] = [
    ("depth", "Which has the most convincing depth?"),
    ("aesthetics", "Which is the most beautiful?"),
    ("overall", "Which is best over all?"),
];

/// Groups of participants: a short name, and what people choose from.
pub const EXPERTISE: [(&str, &str); 3] = [
    ("heritage", "I work with art or cultural heritage"),
    ("rendering", "I work with 3D rendering or computer vision"),
    ("public", "Neither"),
];

/// Why there is no ballot, or no count.
#[derive(Debug, thiserror::Error)]
pub enum BallotError {
    /// A file cannot be read or written.
    #[error("{}: {cause}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Why.
        cause: String,
    },
    /// There is nothing to compare.
    #[error("{0}")]
    Nothing(String),
    /// What was asked for is not there.
    #[error("there is no {what} `{name}`; {help}")]
    Unknown {
        /// Case or method.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest name, or all of them.
        help: String,
    },
    /// A method lacks a case that another one has.
    #[error("the method `{method}` has no case `{case}`, which `{other}` has; run it, or name the others with --case")]
    Unpaired {
        /// The method without it.
        method: String,
        /// The case.
        case: String,
        /// A method with it.
        other: String,
    },
    /// An answer file of another ballot.
    #[error("{}: answers the ballot {found}, the key is of {expected}", file.display())]
    Foreign {
        /// The file.
        file: PathBuf,
        /// What it says.
        found: String,
        /// What the key says.
        expected: String,
    },
    /// An answer that the key does not know.
    #[error("{}: chooses `{token}`, which the key does not have", file.display())]
    Token {
        /// The file.
        file: PathBuf,
        /// The token.
        token: String,
    },
    /// The page cannot be made.
    #[error("the page cannot be made: {0}")]
    Page(#[from] minijinja::Error),
}

/// A case: a painting and what every method made of it.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name.
    pub name: String,
    /// The tradition of the painting; empty if it is not known.
    pub tradition: String,
    /// The painting as JPEG, if there is one.
    pub painting: Option<Vec<u8>>,
    /// By method, what it made of it.
    pub turns: BTreeMap<String, Turn>,
}

/// Views of one scene from several sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// From where each is taken, in degrees; 0 is the painting's own side.
    pub angles: Vec<f64>,
    /// The views as JPEG.
    pub frames: Vec<Vec<u8>>,
}

/// Cases to judge.
#[derive(Clone, Debug, Default)]
pub struct Collected {
    /// The methods, sorted; each case has all of them.
    pub methods: Vec<String>,
    /// The cases.
    pub cases: Vec<Case>,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// What a token stands for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Meaning {
    /// The case.
    pub case: String,
    /// Its tradition.
    pub tradition: String,
    /// The method.
    pub method: String,
}

/// The key of a ballot: what the page does not say.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Key {
    /// [`VERSION`].
    pub ballot_key: u32,
    /// Identifies the ballot.
    pub ballot: String,
    /// The seed.
    pub seed: u64,
    /// The methods.
    pub methods: Vec<String>,
    /// What tokens mean.
    pub tokens: BTreeMap<String, Meaning>,
}

#[cfg(test)]
mod tests;
