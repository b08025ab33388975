//! Range and unit of a parameter.

use std::fmt;
use std::ops::{Range, RangeFrom, RangeInclusive, RangeToInclusive};

use serde::Serialize;

/// One end of a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// The end.
    pub value: f64,
    /// Whether the end itself is allowed.
    pub inclusive: bool,
}

/// Range and unit of a parameter (of each element, for a list).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Limits {
    /// Lower end.
    pub min: Option<Bound>,
    /// Upper end.
    pub max: Option<Bound>,
    /// Unit, such as `px`.
    pub unit: Option<&'static str>,
}

/// A literal of a range.
pub trait Figure: Copy {
    /// As f64.
    fn f64(self) -> f64;
}

impl Figure for f64 {
    fn f64(self) -> f64 {
        self
    }
}

impl Figure for i32 {
    fn f64(self) -> f64 {
        self.into()
    }
}

/// What may stand behind `range =`.
pub trait Interval {
    /// Lower and upper end.
    fn ends(self) -> (Option<Bound>, Option<Bound>);
}

fn end(value: impl Figure, inclusive: bool) -> Option<Bound> {
    Some(Bound {
        value: value.f64(),
        inclusive,
    })
}

impl<T: Figure> Interval for RangeInclusive<T> {
    fn ends(self) -> (Option<Bound>, Option<Bound>) {
        (end(*self.start(), true), end(*self.end(), true))
    }
}

impl<T: Figure> Interval for Range<T> {
    fn ends(self) -> (Option<Bound>, Option<Bound>) {
        (end(self.start, true), end(self.end, false))
    }
}

impl<T: Figure> Interval for RangeFrom<T> {
    fn ends(self) -> (Option<Bound>, Option<Bound>) {
        (end(self.start, true), None)
    }
}

impl<T: Figure> Interval for RangeToInclusive<T> {
    fn ends(self) -> (Option<Bound>, Option<Bound>) {
        (None, end(self.end, true))
    }
}

impl Limits {
    /// No limits.
    pub fn none() -> Self {
        Self::default()
    }

    /// Within a range.
    pub fn within(mut self, range: impl Interval) -> Self {
        (self.min, self.max) = range.ends();
        self
    }

    /// Above a number that is not allowed itself.
    pub fn above(mut self, min: impl Figure) -> Self {
        self.min = end(min, false);
        self
    }

    /// Below a number that is not allowed itself.
    pub fn below(mut self, max: impl Figure) -> Self {
        self.max = end(max, false);
        self
    }

    /// Where nothing else is said, the ends of other limits.
    pub fn or(mut self, other: Self) -> Self {
        self.min = self.min.or(other.min);
        self.max = self.max.or(other.max);
        self
    }

    /// In a unit.
    pub fn unit(mut self, unit: &'static str) -> Self {
        self.unit = Some(unit);
        self
    }

    /// Whether `x` is finite and in range.
    pub fn allow(&self, x: f64) -> bool {
        let above = self.min.is_none_or(|b| x > b.value || (b.inclusive && x == b.value));
        let below = self.max.is_none_or(|b| x < b.value || (b.inclusive && x == b.value));
        x.is_finite() && above && below
    }
}

impl fmt::Display for Limits {
    /// In words: `0 to 50 px`, `above 0`, `at least 1`, `a finite number`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.min, self.max) {
            (None, None) => write!(f, "a finite number")?,
            (Some(a), Some(b)) if a.inclusive && b.inclusive => write!(f, "{} to {}", a.value, b.value)?,
            (min, max) => {
                let mut join = "";
                if let Some(a) = min {
                    let word = if a.inclusive { "at least" } else { "above" };
                    write!(f, "{word} {}", a.value)?;
                    join = " and ";
                }
                if let Some(b) = max {
                    let word = if b.inclusive { "at most" } else { "below" };
                    write!(f, "{join}{word} {}", b.value)?;
                }
            }
        }
        match self.unit {
            Some(unit) => write!(f, " ({unit})"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_in_or_out_as_written() {
        let closed = Limits::none().within(0.0..=1.0);
        assert!(closed.allow(0.0) && closed.allow(1.0) && !closed.allow(1.1));
        let open = Limits::none().above(0).below(1.0);
        assert!(!open.allow(0.0) && open.allow(0.5) && !open.allow(1.0));
        assert!(!Limits::none().within(1..).allow(0.0));
        assert!(!Limits::none().allow(f64::NAN) && !Limits::none().allow(f64::INFINITY));
    }

    #[test]
    fn limits_read_as_words() {
        let text = |limits: Limits| limits.to_string();
        assert_eq!(text(Limits::none().within(0.0..=50.0).unit("px")), "0 to 50 (px)");
        assert_eq!(text(Limits::none().above(0.0)), "above 0");
        assert_eq!(text(Limits::none().within(1..8)), "at least 1 and below 8");
    }
}
