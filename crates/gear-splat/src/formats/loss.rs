//! What a file format cannot hold, told scene by scene.

use std::borrow::Cow;
use std::fmt;

use crate::Scene;

/// Something of a scene that is not in the file, or only roughly.
#[derive(Clone, Debug, PartialEq)]
pub enum Loss {
    /// The format has no place for the canonical camera.
    CanonicalCamera,
    /// The format holds one colour a Gaussian.
    HigherSh {
        /// SH degree of the scene.
        degree: u8,
    },
    /// The format holds finite Gaussians only; the others are left out.
    Invalid {
        /// How many.
        count: usize,
    },
    /// Values beyond what the format can hold were moved to the nearest that it can.
    Cut {
        /// Of which attribute.
        what: &'static str,
        /// How many.
        count: usize,
        /// The range that the format holds.
        range: String,
    },
    /// Values are rounded.
    Rounded(String),
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CanonicalCamera => f.write_str("the canonical camera is not kept"),
            Self::HigherSh { degree } => write!(
                f,
                "SH degree {degree} becomes 0: what depends on the direction of view is not kept"
            ),
            Self::Invalid { count } => write!(f, "{count} Gaussians are not finite and are left out"),
            Self::Cut { what, count, range } => write!(f, "{count} {what} are outside {range} and are cut to it"),
            Self::Rounded(what) => write!(f, "rounded: {what}"),
        }
    }
}

/// The finite Gaussians of a scene, and the loss if there are others.
pub(super) fn finite(scene: &Scene) -> (Cow<'_, Scene>, Vec<Loss>) {
    match scene.count_invalid() {
        0 => (Cow::Borrowed(scene), Vec::new()),
        count => (Cow::Owned(scene.without_invalid().0), vec![Loss::Invalid { count }]),
    }
}

/// Moves values into a range and counts those that were outside.
pub(super) struct Cut {
    pub low: f64,
    pub high: f64,
    count: usize,
}

impl Cut {
    pub fn to(low: f64, high: f64) -> Self {
        Self { low, high, count: 0 }
    }

    /// The nearest value in the range; half a `step` outside still rounds to its end and is no loss.
    pub fn value(&mut self, x: f64, step: f64) -> f64 {
        if x < self.low - 0.5 * step || x > self.high + 0.5 * step {
            self.count += 1;
        }
        x.clamp(self.low, self.high)
    }

    /// The loss, if there is any.
    pub fn loss(&self, what: &'static str, range: impl Into<String>) -> Option<Loss> {
        (self.count > 0).then(|| Loss::Cut {
            what,
            count: self.count,
            range: range.into(),
        })
    }
}
