//! One message for every cause, word for word; and what a good file becomes.

mod causes;
mod overlays;
mod positions;
mod schema;

use std::sync::Arc;

use crate::run::tests::kit::{self, FloorIn, FloorOut};
use crate::*;

/// Must be told its size.
#[derive(Clone, Debug, Params)]
struct Sized {
    /// The size.
    #[param(range = 1..=100, unit = "px")]
    size: u32,
    /// A rectangle, or none.
    r#box: Option<[f64; 4]>,
}

impl Node for Sized {
    const NAME: &str = "Sized";
    const VERSION: u32 = 1;
    type Inputs = FloorIn;
    type Outputs = FloorOut;

    fn run(&self, inputs: FloorIn, _: &Want, _: &Context) -> Result<FloorOut, NodeError> {
        let x = Number(inputs.x.0 + f64::from(self.size));
        Ok(FloorOut {
            whole: Wanted::value(Arc::new(x)),
            rest: Wanted::skipped(),
            large: Wanted::skipped(),
        })
    }
}

fn registry() -> Registry {
    let mut registry = kit::registry();
    registry.node::<Sized>();
    registry
}

fn mistakes(text: &str) -> Mistakes {
    mistakes_of(&GraphSource::new("graph.yaml", text))
}

/// Errors, or else warnings.
fn mistakes_of(source: &GraphSource) -> Mistakes {
    match source.check(&registry()) {
        Ok(graph) => graph.warnings().clone(),
        Err(mistakes) => {
            assert!(mistakes.has_errors());
            mistakes
        }
    }
}

#[test]
fn overrides_get_the_same_messages() {
    let text = "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}}
  c: {node: Choose, in: {a: x, b: x}}
outputs: {y: a.sum, z: c.chosen}
";
    let set = [
        "a.pluss=1",
        "a.plus=much",
        "b.plus=1",
        "xx.scale=2",
        "a.plus",
        "plus=1",
        "x.scale=[",
        "c.when.above.treshold=3",
    ];
    let mut source = GraphSource::new("graph.yaml", text);
    source.set = set.map(String::from).to_vec();
    insta::assert_snapshot!(mistakes_of(&source));
}

#[test]
fn overrides_reach_nodes_inputs_and_methods() {
    let text = "gear: 1
inputs: {x: Number, y: {type: Number, with: {scale: 3}}}
nodes:
  a: {node: Add, in: {of: [x, y]}, with: {plus: 1}}
  c: {node: Choose, in: {a: a.sum, b: x}, with: {when: never}}
outputs: {z: c.chosen}
";
    let set = ["a.plus=2", "a.plus=3", "x.scale=2", "c.when.above.threshold=7"];
    let mut source = GraphSource::new("graph.yaml", text);
    source.set = set.map(String::from).to_vec();
    let graph = source.check(&registry()).unwrap();
    let params = |i: usize| serde_json::Value::Object(graph.nodes()[i].params()).to_string();
    assert_eq!(params(0), r#"{"plus":3.0}"#, "the last one wins");
    assert_eq!(params(1), r#"{"when":{"above":{"threshold":7.0}}}"#);
    let scale = |i: usize| graph.inputs()[i].params()["scale"].clone();
    assert_eq!((scale(0), scale(1)), (2.0.into(), 3.0.into()));
}

#[test]
fn mistakes_for_editors_have_lines_and_columns() {
    let text = "gear: 1\ninputs: {x: Number}\nnodes:\n  a: {node: Adder, in: {of: x}}\noutputs: {y: a.sum}\n";
    let mistakes = GraphSource::new("graph.yaml", text).check(&registry()).unwrap_err();
    insta::assert_json_snapshot!(mistakes.to_json());
}

#[test]
fn a_good_graph_is_what_was_written() {
    let text = "gear: 1
inputs: {x: Number, y: {type: Number, optional: true}}
nodes:
  sum: {node: Add, in: {of: [x, y]}}
  choose: {node: Choose, in: {a: sum.sum, b: x}}
outputs: {chosen: choose.chosen, raw: x}
";
    let graph = GraphSource::new("graph.yaml", text).check(&registry()).unwrap();
    assert!(graph.warnings().is_empty());
    assert_eq!(graph.wiring(0), [("of", "x".to_string()), ("of", "y".to_string())]);
    assert_eq!(graph.wiring(1), [("a", "sum.sum".to_string()), ("b", "x".to_string())]);
    assert_eq!(graph.output_source(&graph.outputs()[0]), "choose.chosen");
    insta::assert_snapshot!("mermaid", graph.to_mermaid());
    insta::assert_snapshot!("dot", graph.to_dot());
}

#[test]
fn a_huge_text_is_not_told_back() {
    let word = "word".repeat(250_000);
    for text in [
        word.clone(),
        format!("{{gear: 1, inputs: {{x: {word}}}, outputs: {{y: {word}}}, nodes: [{word}]}}"),
        format!("{{gear: 1, inputs: {{{word}: Number}}}}"),
        format!("gear: [{word}"),
    ] {
        let said = mistakes(&text).to_string();
        assert!(said.len() < 8_000, "{} bytes", said.len());
        assert!(said.contains('…'), "{said}");
    }
}

#[test]
fn no_text_makes_the_reader_panic() {
    let good = "gear: 1\ninputs: {x: Number}\nnodes:\n  a: {node: Add, in: {of: [x, x]}, with: {plus: 1}}\noutputs: {y: a.sum}\n";
    for cut in 0..good.len() {
        let _ = GraphSource::new("cut.yaml", &good[..cut]).check(&registry());
        for with in ["\t", "}", "&a", "*a", "é", ": ", "\u{0}", "[", "- ", "!!int "] {
            let text = format!("{}{with}{}", &good[..cut], &good[cut..]);
            let mistakes = GraphSource::new("edited.yaml", text).check(&registry());
            if let Err(mistakes) = mistakes {
                mistakes.render(true);
                mistakes.to_json();
            }
        }
    }
}

#[test]
fn texts_that_never_end_are_told_in_words_of_graphs() {
    let mut bomb = String::from("gear: 1\ninputs:\n  a: &a [x, x]\n");
    for (name, of) in ('b'..='z').zip('a'..) {
        bomb.push_str(&format!("  {name}: &{name} [*{of}, *{of}, *{of}, *{of}]\n"));
    }
    for (text, told) in [
        (bomb.as_str(), "unfolds to more than can be read"),
        (&format!("gear: 1\ninputs: {}", "[".repeat(20_000)), "nested too deeply"),
        ("gear: 1\nnodes: &n {a: *n}\n", "an anchor holds itself"),
        ("gear: 1\nnodes:\noutputs:\n", "the graph has no outputs"),
    ] {
        let mistakes = mistakes(text).to_string();
        assert!(mistakes.contains(told), "expected `{told}` in: {mistakes}");
    }
}
