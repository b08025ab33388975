//! What came out of a study: a row for every pair of a case and a variant, and the numbers made of the rows.

use gear_report::picture::Pixels;

use super::file::Study;
use crate::csv::line;
use crate::stats::{self, Paired, Spread};

/// Everything that came out.
#[derive(Clone, Debug, Default)]
pub struct Results {
    /// The rows, case by case.
    pub rows: Vec<Row>,
    /// Outputs of nodes that had been computed before for the same case with the same parameters. 0, unless nodes do not
    /// promise the same bits again or the store lost something.
    pub repeated: usize,
    /// Whether it was stopped before the end.
    pub interrupted: bool,
}

/// One case through one variant.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Number of the case.
    pub case: usize,
    /// Number of the variant.
    pub variant: usize,
    /// Why there are no results, or not all.
    pub failure: Option<String>,
    /// The measures, in their order; `None` is undefined.
    pub values: Vec<Option<f64>>,
    /// Seconds on the clock, with what was shared already there.
    pub seconds: f64,
    /// The nodes that ran.
    pub ran: Vec<String>,
    /// The outputs that were computed: node and port.
    pub computed: Vec<(String, String)>,
    /// How many nodes' results were stored.
    pub stored: usize,
    /// The file with the picture of the case, below the output folder, if views are kept and it can be shown.
    pub painting: Option<String>,
    /// The views: names, such as `yaw+30`, and their files below the output folder.
    pub views: Vec<(String, String)>,
    /// Painting and views as the contact sheet shows them; empty for cases that are not on it.
    pub small: Vec<Option<Pixels>>,
}

/// Nodes that ran and nodes that were needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Executions {
    /// Nodes that ran.
    pub ran: usize,
    /// Nodes that ran or were stored, each counted for every variant and case.
    pub needed: usize,
}

impl Results {
    /// The value of a measure in every case, for one variant.
    pub fn values(&self, study: &Study, variant: usize, measure: usize) -> Vec<Option<f64>> {
        let mut values = vec![None; study.cases.len()];
        for row in self.rows.iter().filter(|row| row.variant == variant) {
            values[row.case] = row.values[measure];
        }
        values
    }

    /// Mean and spread of a measure over the cases that `keep` keeps.
    pub fn spread(
        &self,
        study: &Study,
        variant: usize,
        measure: usize,
        keep: &dyn Fn(usize) -> bool,
    ) -> Option<Spread> {
        let values = self.values(study, variant, measure).into_iter().enumerate();
        let kept: Vec<f64> = values
            .filter(|(case, _)| keep(*case))
            .filter_map(|(_, value)| value)
            .collect();
        stats::spread(&kept)
    }

    /// How a variant differs from another in a measure, case by case.
    pub fn paired(&self, study: &Study, variant: usize, other: usize, measure: usize) -> Option<Paired> {
        let (this, that) = (self.values(study, variant, measure), self.values(study, other, measure));
        stats::paired(&this, &that, study.seed)
    }

    /// What ran, against what was needed.
    pub fn executions(&self) -> Executions {
        let ran = self.rows.iter().map(|row| row.ran.len()).sum();
        Executions {
            ran,
            needed: ran + self.rows.iter().map(|row| row.stored).sum::<usize>(),
        }
    }

    /// Every row as CSV: case, its fields, variant, measures, seconds, what ran, what went wrong.
    pub fn rows_csv(&self, study: &Study) -> String {
        let mut fields: Vec<&str> = Vec::new();
        for (field, _) in study.cases.iter().flat_map(|case| &case.fields) {
            if !fields.contains(&field.as_str()) {
                fields.push(field);
            }
        }
        let mut head = vec!["case", "picture"];
        head.extend(&fields);
        head.push("variant");
        head.extend(study.measures.iter().map(|measure| measure.name.as_str()));
        head.extend(["seconds", "nodes_ran", "nodes_stored", "failure"]);
        let mut text = line(head.iter().map(|cell| (*cell).to_owned()));
        for row in &self.rows {
            let case = &study.cases[row.case];
            let mut cells = vec![case.name.clone(), case.picture.to_string()];
            cells.extend(
                fields
                    .iter()
                    .map(|field| case.field(field).unwrap_or_default().to_owned()),
            );
            cells.push(study.variants[row.variant].name.clone());
            cells.extend(
                row.values
                    .iter()
                    .map(|value| value.map(|v| v.to_string()).unwrap_or_default()),
            );
            cells.push(format!("{:.3}", row.seconds));
            cells.push(row.ran.len().to_string());
            cells.push(row.stored.to_string());
            // One row, one line: what people read with `grep`.
            cells.push(row.failure.clone().unwrap_or_default().replace('\n', "; "));
            text.push_str(&line(cells.into_iter()));
        }
        text
    }

    /// Mean, spread and the difference to the baseline as CSV, a line a variant and measure, for all cases and for
    /// every group.
    pub fn summary_csv(&self, study: &Study) -> String {
        let head = [
            "group",
            "value",
            "variant",
            "measure",
            "cases",
            "mean",
            "deviation",
            "difference",
            "low",
            "high",
            "larger",
            "smaller",
            "paper",
        ];
        let mut text = line(head.into_iter().map(str::to_owned));
        for (group, value, cases) in study.parts() {
            let of = |variant: usize, measure: usize| -> Vec<Option<f64>> {
                let values = self.values(study, variant, measure);
                cases.iter().map(|case| values[*case]).collect()
            };
            for (v, variant) in study.variants.iter().enumerate() {
                for (m, measure) in study.measures.iter().enumerate() {
                    let finite: Vec<f64> = of(v, m).into_iter().flatten().collect();
                    let spread = stats::spread(&finite);
                    let paired = (v != study.baseline)
                        .then(|| stats::paired(&of(v, m), &of(study.baseline, m), study.seed))
                        .flatten();
                    let number = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
                    let interval = paired.and_then(|p| p.interval);
                    let paper = group
                        .is_empty()
                        .then(|| variant.paper.get(&measure.name).copied())
                        .flatten();
                    text.push_str(&line(
                        [
                            group.to_owned(),
                            value.clone(),
                            variant.name.clone(),
                            measure.name.clone(),
                            finite.len().to_string(),
                            number(spread.map(|s| s.mean)),
                            number(spread.map(|s| s.deviation)),
                            number(paired.map(|p| p.mean)),
                            number(interval.map(|i| i.low)),
                            number(interval.map(|i| i.high)),
                            number(paired.map(|p| p.larger as f64)),
                            number(paired.map(|p| p.smaller as f64)),
                            number(paper),
                        ]
                        .into_iter(),
                    ));
                }
            }
        }
        text
    }
}

impl Study {
    /// All cases, and then the cases of every value of every group: (group, value, cases).
    pub fn parts(&self) -> Vec<(&str, String, Vec<usize>)> {
        let mut parts = vec![("", String::new(), (0..self.cases.len()).collect())];
        for group in &self.groups {
            for value in self.group_values(group) {
                let cases = (0..self.cases.len()).filter(|case| self.group_of(group, *case) == value);
                parts.push((group, value.clone(), cases.collect()));
            }
        }
        parts
    }

    /// The values of a group, in the order in which cases have them.
    pub fn group_values(&self, group: &str) -> Vec<String> {
        let mut values = Vec::new();
        for case in 0..self.cases.len() {
            let value = self.group_of(group, case);
            if !values.contains(&value) {
                values.push(value);
            }
        }
        values
    }

    fn group_of(&self, group: &str, case: usize) -> String {
        self.cases[case].field(group).unwrap_or("not given").to_owned()
    }
}
