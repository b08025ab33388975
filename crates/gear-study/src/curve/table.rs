//! The table of a curve as CSV.
//!
//! ```csv
//! # title: Levels of the pyramid
//! # norm: rms of ratio
//! # machine: 2 cores
//! label,family,seconds,operations,error,default
//! levels = 1,,0.0012,,0.31,
//! levels = auto,,0.0045,,0.0,yes
//! ```
//!
//! `operations` is a count that costs are compared by where there is one (`# operations:` says what is counted);
//! otherwise seconds are. `# decision: NNNN` names the decision record that says why a default is off the front.
//! Programs that measure kernels write the same format.

use gear_report::precision::{Diagram, Point as Drawn};

use super::front::on_front;

/// Everything that was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// What is varied.
    pub title: String,
    /// What the error is, such as `rms of ratio, against levels = 7`.
    pub norm: String,
    /// What `operations` counts, if anything.
    pub operations: Option<String>,
    /// Where seconds were measured.
    pub machine: String,
    /// The number of the decision record that says why the default is off the front.
    pub decision: Option<String>,
    /// The points.
    pub points: Vec<Point>,
}

/// One setting.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// The values of the knobs, in words.
    pub label: String,
    /// Points of one family are joined by a line.
    pub family: String,
    /// Median seconds of the nodes that are timed.
    pub seconds: f64,
    /// A count of operations.
    pub operations: Option<f64>,
    /// The error.
    pub error: f64,
    /// Whether this is what is shipped.
    pub default: bool,
}

/// What is wrong with a table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct BadTable {
    /// The line, from 1.
    pub line: usize,
    /// What was found and what was expected.
    pub problem: String,
}

const HEAD: &str = "label,family,seconds,operations,error,default";

impl Curve {
    /// What a point costs: operations where they are counted, else seconds.
    pub fn cost(&self, point: &Point) -> f64 {
        match (&self.operations, point.operations) {
            (Some(_), Some(operations)) => operations,
            _ => point.seconds,
        }
    }

    /// As CSV.
    pub fn csv(&self) -> String {
        let mut text = format!("# title: {}\n# norm: {}\n", self.title, self.norm);
        if let Some(operations) = &self.operations {
            text.push_str(&format!("# operations: {operations}\n"));
        }
        text.push_str(&format!("# machine: {}\n", self.machine));
        if let Some(decision) = &self.decision {
            text.push_str(&format!("# decision: {decision}\n"));
        }
        text.push_str(HEAD);
        text.push('\n');
        for point in &self.points {
            text.push_str(&format!(
                "{},{},{},{},{},{}\n",
                plain(&point.label),
                plain(&point.family),
                digits(point.seconds),
                point.operations.map(|o| o.to_string()).unwrap_or_default(),
                digits(point.error),
                if point.default { "yes" } else { "" },
            ));
        }
        text
    }

    /// Reads what [`Curve::csv`] writes.
    pub fn parse(text: &str) -> Result<Self, BadTable> {
        let mut curve = Self::default();
        let mut head = false;
        for (i, line) in text.lines().enumerate() {
            let bad = |problem: String| BadTable { line: i + 1, problem };
            if let Some(remark) = line.strip_prefix('#') {
                if let Some((key, value)) = remark.split_once(':') {
                    let value = value.trim().to_owned();
                    match key.trim() {
                        "title" => curve.title = value,
                        "norm" => curve.norm = value,
                        "operations" => curve.operations = Some(value),
                        "machine" => curve.machine = value,
                        "decision" => curve.decision = Some(value),
                        _ => {}
                    }
                }
                continue;
            }
            if line.trim().is_empty() {
                continue;
            }
            if !head {
                if line != HEAD {
                    return Err(bad(format!("found `{line}`, expected `{HEAD}`")));
                }
                head = true;
                continue;
            }
            let cells: Vec<&str> = line.split(',').collect();
            let [label, family, seconds, operations, error, default] = cells[..] else {
                return Err(bad(format!("found {} cells, expected 6", cells.len())));
            };
            let number = |cell: &str, what: &str| {
                let parsed = cell.parse::<f64>();
                parsed.map_err(|_| bad(format!("`{cell}` is no number of {what}")))
            };
            curve.points.push(Point {
                label: label.to_owned(),
                family: family.to_owned(),
                seconds: number(seconds, "seconds")?,
                operations: match operations {
                    "" => None,
                    some => Some(number(some, "operations")?),
                },
                error: number(error, "the error")?,
                default: default == "yes",
            });
        }
        match curve.points.is_empty() {
            true => Err(BadTable {
                line: text.lines().count(),
                problem: format!("no point; expected `{HEAD}` and lines below it"),
            }),
            false => Ok(curve),
        }
    }

    /// The work–precision diagram as SVG; `None` if nothing can be drawn.
    pub fn svg(&self) -> Option<String> {
        let points = self.points.iter().map(|point| Drawn {
            label: point.label.clone(),
            cost: self.cost(point),
            error: point.error,
            family: point.family.clone(),
            front: on_front(self, point),
            default: point.default,
        });
        let diagram = Diagram {
            title: self.title.clone(),
            cost: self.operations.clone().unwrap_or_else(|| "seconds".to_owned()),
            error: self.norm.clone(),
            points: points.collect(),
        };
        diagram.svg()
    }
}

/// A text in a cell: commas part cells.
fn plain(text: &str) -> String {
    text.replace([',', '\n'], ";")
}

/// Four digits: what is measured has no more.
fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    format!("{value:.3e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_reads_back_what_it_wrote() {
        let curve = Curve {
            title: "Levels".into(),
            norm: "rms of ratio".into(),
            operations: Some("pixels".into()),
            machine: "2 cores".into(),
            decision: Some("0031".into()),
            points: vec![
                Point {
                    label: "levels = 1".into(),
                    family: "f32".into(),
                    seconds: 1.25e-3,
                    operations: Some(4.0),
                    error: 0.5,
                    default: false,
                },
                Point {
                    label: "auto".into(),
                    seconds: 2.5,
                    default: true,
                    ..Point::default()
                },
            ],
        };
        assert_eq!(Curve::parse(&curve.csv()).unwrap(), curve);
        assert!(curve.svg().unwrap().contains("auto"));
    }

    #[test]
    fn what_is_no_table_is_told_by_its_line() {
        let told = |text: &str| Curve::parse(text).unwrap_err().to_string();
        assert!(told("").contains("no point"));
        assert!(told("# title: x\nlabel,error\n").starts_with("line 2"));
        assert!(told(&format!("{HEAD}\na,,fast,,1,\n")).contains("`fast`"));
    }
}
