//! Verdict: what a Judge's report says of one method.
//!
//! A study has a row for each variant, and one Judge sees all methods at once. So the variants of a study share the Judge
//! and differ in whose scores they read.

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Report, Want};
use serde_json::{Map, Value, json};

use crate::tally::DIMENSIONS;

/// One method's scores, from the report of a Judge.
#[derive(Clone, Debug, Params)]
pub struct Verdict {
    /// The method, as the Judge's parameter `methods` calls it; empty for the first.
    #[param(default = String::new())]
    pub method: String,
}

/// Input ports.
#[derive(Inputs)]
pub struct In {
    /// The report of a Judge.
    pub judged: Arc<Report>,
}

/// Output ports.
#[derive(Outputs)]
pub struct Out {
    /// `TF`, `GA`, `VC`, `AC` and their `mean`, 1 to 10; `agreement` of the votes and the largest `position_bias`.
    pub report: Arc<Report>,
}

impl Node for Verdict {
    const NAME: &str = "Verdict";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let judged = &inputs.judged.0;
        let scores = verdict(judged, &self.method)?;
        Ok(Out {
            report: Arc::new(Report(Value::Object(scores))),
        })
    }
}

fn verdict(judged: &Value, wanted: &str) -> Result<Map<String, Value>, NodeError> {
    let Some(methods) = judged["methods"].as_array() else {
        return Err(NodeError::input(
            "judged",
            "found a report without `methods`; wire the report of a Judge here",
        ));
    };
    let named = |method: &&Value| wanted.is_empty() || method["name"] == wanted;
    let Some(method) = methods.iter().find(named) else {
        let names: Vec<_> = methods.iter().filter_map(|method| method["name"].as_str()).collect();
        return Err(NodeError::param(
            "method",
            format!("found `{wanted}`; the judge saw {}", names.join(", ")),
        ));
    };
    let means = DIMENSIONS.iter().map(|d| ((*d).to_owned(), method[*d]["mean"].clone()));
    let mut scores: Map<String, Value> = means.collect();
    scores.insert("mean".to_owned(), method["mean"].clone());
    scores.insert("agreement".to_owned(), judged["agreement"].clone());
    scores.insert("position_bias".to_owned(), judged["position_bias"]["largest"].clone());
    match scores
        .iter()
        .find(|(name, score)| !score.is_number() && *name != "agreement" && *name != "position_bias")
    {
        None => Ok(scores),
        Some((name, found)) => Err(NodeError::input(
            "judged",
            format!(
                "found `{name}` of `{wanted}` to be {}; wire the report of a Judge here",
                json!(found)
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use gear_graph::testing;

    use super::*;

    fn asked(judged: Value, method: &str) -> Result<Value, String> {
        let node = Verdict {
            method: method.to_owned(),
        };
        let inputs = In {
            judged: Arc::new(Report(judged)),
        };
        let out = testing::run(&node, inputs).map_err(|error| error.to_string())?;
        Ok(out.report.0.clone())
    }

    fn judged() -> Value {
        let score = |mean: f64| json!({"mean": mean, "spread": null});
        let method = |name, mean| json!({"name": name, "TF": score(mean), "GA": score(2.0), "VC": score(3.0), "AC": score(4.0), "mean": 2.5});
        json!({"methods": [method("raw", 1.0), method("GeAR", 9.0)], "agreement": null, "position_bias": {"largest": 0.5}})
    }

    #[test]
    fn the_row_of_a_method() {
        let expected =
            json!({"TF": 9.0, "GA": 2.0, "VC": 3.0, "AC": 4.0, "mean": 2.5, "agreement": null, "position_bias": 0.5});
        assert_eq!(asked(judged(), "GeAR").unwrap(), expected);
        assert_eq!(asked(judged(), "").unwrap()["TF"], 1.0, "the first");
    }

    #[test]
    fn the_same_bits_every_time() {
        let node = Verdict { method: String::new() };
        testing::assert_pure(&node, || In {
            judged: Arc::new(Report(judged())),
        });
    }

    #[test]
    fn what_is_no_report_of_a_judge_or_no_method_is_told() {
        let message = asked(judged(), "Gear").unwrap_err();
        assert!(message.contains("the judge saw raw, GeAR"), "{message}");
        assert!(
            asked(json!({"vend": 1}), "GeAR")
                .unwrap_err()
                .contains("report of a Judge")
        );
        let hollow = json!({"methods": [{"name": "GeAR"}]});
        assert!(asked(hollow, "GeAR").unwrap_err().contains("`TF` of `GeAR` to be null"));
        testing::assert_extremes(&Verdict {
            method: "raw".to_owned(),
        });
    }
}
