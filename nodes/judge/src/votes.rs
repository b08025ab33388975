//! One vote: the order, the question, the answer and its repair.

use gear_graph::{Context, Digest, NodeError};
use gear_service::{Chat, Kind, Memory, Part, Services};
use serde_json::Value;

use crate::Judge;
use crate::sheet::Sheets;
use crate::tally::{DIMENSIONS, LETTERS, Vote};

const SYSTEM: &str = "You are an expert in classical painting and in 3D reconstruction. You compare renderings of 3D scenes \
that were made from one painting. You do not know which method made which. Judge only what you see.";

const RUBRICS: &str = "Score every candidate from 1 (fails) to 10 (cannot be told from ideal) on four dimensions:\n\
TF, texture fidelity: brushwork, line, pattern and pigment of the painting are there, sharp and in place.\n\
GA, geometric accuracy: the shape is plausible from every side; no holes, floating parts, double outlines or flat cut-outs.\n\
VC, view consistency: the views show one and the same object; nothing appears, vanishes or changes colour between them.\n\
AC, aesthetic consistency: the whole keeps the style, palette and mood of the painting.\n\
Use the whole scale, and different scores where the candidates differ.";

/// What all votes share.
pub struct Bench<'a> {
    chat: Chat<'a>,
    judge: &'a Judge,
    sheets: &'a Sheets,
    memory: Memory<'a>,
}

impl<'a> Bench<'a> {
    pub fn open(
        judge: &'a Judge,
        sheets: &'a Sheets,
        ctx: &'a Context,
        interrupted: &'a (dyn Fn() -> bool + Sync),
    ) -> Result<Self, NodeError> {
        let services = Services::lent(ctx.resources());
        let endpoint = services.get(Kind::Chat).map_err(NodeError::new)?;
        Ok(Self {
            chat: Chat::new(endpoint, judge.patience.policy(), interrupted),
            judge,
            sheets,
            memory: Memory::open(ctx),
        })
    }

    /// Asks once, with repairs; or takes the vote that an interrupted run had already.
    pub fn vote(&self, number: u32) -> Result<Vote, NodeError> {
        let order = order(self.sheets.methods.len(), number, self.judge.seed);
        let name = format!("vote {number}");
        let remembered = self.memory.get(&name).and_then(|bytes| String::from_utf8(bytes).ok());
        if let Some((model, text)) = remembered.as_deref().and_then(|kept| kept.split_once('\n'))
            && let Ok(scores) = scores(text, order.len())
        {
            return Ok(Vote::new(
                order,
                scores,
                Some(model.to_owned()).filter(|model| !model.is_empty()),
            ));
        }
        let mut parts = self.question(&order);
        let mut tries = 0;
        loop {
            let said = self.chat.ask(
                SYSTEM,
                &parts,
                self.judge.seed + u64::from(number),
                self.judge.temperature.value(),
            )?;
            match scores(&said.text, order.len()) {
                Ok(scores) => {
                    let model = said.model.unwrap_or_default().replace('\n', " ");
                    self.memory.keep(&name, format!("{model}\n{}", said.text).into_bytes());
                    return Ok(Vote::new(order, scores, Some(model).filter(|model| !model.is_empty())));
                }
                Err(problem) if tries < self.judge.repairs => {
                    tries += 1;
                    let answer: String = said.text.chars().take(2000).collect();
                    let again = format!(
                        "You answered:\n{answer}\nThat cannot be used: {problem}. Answer again, with the JSON object alone."
                    );
                    parts.push(Part::Text(again));
                }
                Err(problem) => {
                    let times = tries + 1;
                    return Err(NodeError::new(format!(
                        "vote {}: the model's answer cannot be used after {times} tries: {problem}",
                        number + 1
                    )));
                }
            }
        }
    }

    fn question(&self, order: &[usize]) -> Vec<Part> {
        let mut parts = vec![
            Part::Text("The painting:".to_owned()),
            Part::Png(self.sheets.painting.clone()),
        ];
        for (letter, method) in LETTERS.iter().zip(order) {
            parts.push(Part::Text(format!("Candidate {letter}, from several sides:")));
            parts.push(Part::Png(self.sheets.methods[*method].clone()));
        }
        let example: Vec<String> = LETTERS[..order.len()]
            .iter()
            .map(|letter| format!("\"{letter}\": {{\"TF\": …, \"GA\": …, \"VC\": …, \"AC\": …}}"))
            .collect();
        let form = format!(
            "Answer with one JSON object and nothing else: {{{}}}",
            example.join(", ")
        );
        parts.push(Part::Text(format!("{RUBRICS}\n{form}")));
        parts
    }
}

/// The order in which the methods stand in a vote. Each run of as many votes as methods is a Latin square of one drawn
/// order: every method stands in every place once.
pub fn order(methods: usize, number: u32, seed: u64) -> Vec<usize> {
    let (square, row) = (number as usize / methods, number as usize % methods);
    let mut drawn: Vec<usize> = (0..methods).collect();
    drawn.sort_by_key(|method| Digest::of(format!("order {seed} {square} {method}").as_bytes()).0);
    (0..methods).map(|place| drawn[(place + row) % methods]).collect()
}

/// The scores in an answer, by place and dimension.
fn scores(text: &str, places: usize) -> Result<Vec<[f64; 4]>, String> {
    // Some models wrap JSON in a fence whatever one asks for.
    let json = match (text.find('{'), text.rfind('}')) {
        (Some(start), Some(end)) if start < end => &text[start..=end],
        _ => return Err("there is no JSON object in it".to_owned()),
    };
    let json: Value = serde_json::from_str(json).map_err(|error| format!("it is no JSON ({error})"))?;
    let score = |letter: &str, dimension: &str| {
        let found = &json[letter][dimension];
        match found.as_f64() {
            Some(score) if (1.0..=10.0).contains(&score) => Ok(score),
            _ => Err(format!(
                "`{letter}`.`{dimension}` is {found}, expected a number from 1 to 10"
            )),
        }
    };
    (0..places)
        .map(|place| {
            let mut row = [0.0; 4];
            for (score_of, dimension) in row.iter_mut().zip(DIMENSIONS) {
                *score_of = score(LETTERS[place], dimension)?;
            }
            Ok(row)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_stands_in_every_place_once() {
        for methods in 2..6 {
            for place in 0..methods {
                let mut there: Vec<usize> = (0..methods as u32).map(|vote| order(methods, vote, 9)[place]).collect();
                there.sort_unstable();
                assert_eq!(there, (0..methods).collect::<Vec<_>>());
            }
        }
        let orders: std::collections::BTreeSet<_> = (0..40).map(|seed| order(4, 0, seed)).collect();
        assert!(orders.len() > 10, "the seed draws the order");
    }

    #[test]
    fn an_answer_is_read_or_told_what_is_wrong_with_it() {
        let good = "```json\n{\"A\": {\"TF\": 7, \"GA\": 6.5, \"VC\": 1, \"AC\": 10}, \"B\": {\"TF\": 2, \"GA\": 2, \"VC\": 2, \"AC\": 2}}\n```";
        assert_eq!(scores(good, 2).unwrap(), [[7.0, 6.5, 1.0, 10.0], [2.0; 4]]);
        for (bad, expected) in [
            ("B is best", "no JSON object"),
            ("{\"A\": }", "no JSON"),
            ("{\"A\": {\"TF\": 11}}", "`A`.`TF` is 11"),
            ("{\"A\": {\"TF\": \"7\"}}", "expected a number"),
            (good, "`C`.`TF` is null"),
        ] {
            let problem = scores(bad, 3).unwrap_err();
            assert!(problem.contains(expected), "{bad}: {problem}");
        }
    }
}
