//! An explanation, in words.

use std::fmt;

use super::{Difference, EarlierRun, Part, Why};
use crate::PlannedState;

/// Of an input that differs, so many facts are told; of more only the number.
const FACTS: usize = 4;

/// An explanation with every fact in which inputs differ.
pub struct WithValues<'w>(pub &'w Why);

impl fmt::Display for WithValues<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.tell(f, true)
    }
}

impl fmt::Display for Why {
    /// Several lines, without the facts of large values.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.tell(f, false)
    }
}

impl Why {
    fn tell(&self, f: &mut fmt::Formatter<'_>, values: bool) -> fmt::Result {
        let own_name = self.outputs == [self.node.as_str()];
        let names: Vec<String> = match own_name {
            true => vec![self.node.clone()],
            false => self
                .outputs
                .iter()
                .map(|port| format!("{}.{port}", self.node))
                .collect(),
        };
        let state = match self.state {
            PlannedState::Runs => "runs",
            PlannedState::MayRun => "may run",
            PlannedState::Cached => "is stored",
            PlannedState::LeftOut => "is left out",
            PlannedState::Given => "is given as a value",
            PlannedState::NotGiven => "is not given, and optional",
        };
        write!(f, "{} ({}) {state}", names.join(", "), self.type_name)?;
        if !self.reason.is_empty() && self.state != PlannedState::Cached {
            write!(f, ": {}", self.reason)?;
        }
        match (self.state, &self.computed) {
            (PlannedState::Cached, Some(run)) => write!(f, "\n  computed by {run}")?,
            (PlannedState::Cached, None) => write!(
                f,
                "\n  which run computed it is not known: the store kept no word of it, or dropped it"
            )?,
            (PlannedState::Runs | PlannedState::MayRun, Some(run)) => {
                write!(f, "\n  the same was computed before, by {run}")?;
            }
            (PlannedState::Runs | PlannedState::MayRun, None) => {}
            _ => return Ok(()),
        }
        match &self.nearest {
            None if self.state == PlannedState::Cached && self.computed.is_none() => {}
            None => {
                let before = if self.computed.is_some() { " before that" } else { "" };
                write!(
                    f,
                    "\n  the store knows no other run of it, and none of another {}{before}",
                    self.type_name
                )?;
            }
            Some(run) => {
                let whose = if run.node == self.node { "it" } else { "one like it" };
                let before = if self.computed.is_some() {
                    "before that"
                } else {
                    "so far"
                };
                write!(f, "\n  the nearest run of {whose} {before}: {run}")?;
                let other = if self.computed.is_some() {
                    "it differed in"
                } else {
                    "what is different now"
                };
                match (self.differences.len(), self.ahead.len()) {
                    (0, 0) => write!(f, "\n  no part of its key is different")?,
                    (0, _) => write!(f, "\n  nothing is different that is known already")?,
                    _ => write!(f, "\n  {other}:")?,
                }
            }
        }
        for difference in &self.differences {
            write!(f, "\n    {difference}")?;
            if !values && difference.summary.len() > FACTS {
                write!(f, "\n      {} of its values differ", difference.summary.len())?;
                continue;
            }
            for (name, old, new) in &difference.summary {
                write!(f, "\n      {name}: {old} -> {new}")?;
            }
        }
        for ahead in &self.ahead {
            if !ahead.certain {
                let (port, source) = (&ahead.port, &ahead.source);
                write!(f, "\n  values decide whether `{port}` ({source}) is asked for")?;
                continue;
            }
            write!(f, "\n  `{}` is known only after `{}` has run", ahead.port, ahead.source)?;
            for (node, reason) in &ahead.begins {
                write!(f, "\n    it begins at `{node}`: {reason}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for EarlierRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "run {} on {}, `{}` of {}, in {:.1} s",
            self.run,
            utc(self.made),
            self.node,
            self.graph,
            self.seconds
        )
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let short = |value: &Option<String>| match value {
            None => "none".to_string(),
            Some(text) => text.clone(),
        };
        let (old, new) = (short(&self.old), short(&self.new));
        match self.part {
            Part::Parameter => write!(f, "parameter {}: {old} -> {new}", self.name),
            Part::Type => write!(f, "node type: {old} -> {new}"),
            Part::Version => write!(f, "version of {}: {old} -> {new}", self.name),
            Part::Numerics => write!(f, "numerics of {}: {old} -> {new}", self.name),
            Part::Realm => write!(f, "realm: {old} -> {new}"),
            Part::Elision => write!(f, "elision: {old} -> {new}"),
            Part::Input => {
                write!(f, "input {}", self.name)?;
                if let Some(source) = &self.source {
                    write!(f, " ({source})")?;
                }
                match (&self.old, &self.new) {
                    (Some(old), Some(new)) => write!(f, ": content {} -> {}", start(old), start(new)),
                    (None, _) => write!(f, ": was not asked for, and is now"),
                    (_, None) => write!(f, ": was asked for, and is not now"),
                }
            }
        }
    }
}

/// As much of digests as people compare.
fn start(digests: &str) -> String {
    let all: Vec<_> = digests.split(' ').map(|hex| hex.get(..12).unwrap_or(hex)).collect();
    match all.as_slice() {
        few if few.len() <= 3 => few.join(" "),
        [first, .., last] => format!("{first} … {last}"),
        _ => String::new(),
    }
}

/// A time as `2026-11-23 12:44:42 UTC`. The calendar's arithmetic is that of Howard Hinnant's `civil_from_days`.
fn utc(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 {
        month_from_march + 3
    } else {
        month_from_march - 9
    };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!(
        "{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC",
        rest / 3600,
        rest / 60 % 60,
        rest % 60
    )
}

#[cfg(test)]
mod tests {
    use super::utc;

    #[test]
    fn times_are_told_in_utc() {
        assert_eq!(utc(0), "1970-01-01 00:00:00 UTC");
        assert_eq!(utc(951_782_399), "2000-02-28 23:59:59 UTC");
        assert_eq!(utc(951_782_400), "2000-02-29 00:00:00 UTC");
        assert_eq!(utc(1_795_437_882), "2026-11-23 12:44:42 UTC");
    }
}
