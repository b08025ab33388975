//! One message for every cause, word for word; and what a good file becomes.

mod overlays;

use crate::run::tests::kit::*;
use crate::*;

fn mistakes(text: &str) -> String {
    mistakes_set(text, &[])
}

fn mistakes_set(text: &str, set: &[&str]) -> String {
    let mut source = GraphSource::new("graph.yaml", text);
    source.set = set.iter().map(ToString::to_string).collect();
    match source.check(&registry()) {
        Ok(graph) => graph.warnings().render(false),
        Err(mistakes) => {
            assert!(mistakes.has_errors());
            mistakes.render(false)
        }
    }
}

/// A snapshot of the messages for one body of a graph file that is fine but for what is tested.
macro_rules! says {
    ($($name:ident: $text:expr;)*) => {$(
        #[test]
        fn $name() {
            insta::assert_snapshot!(mistakes($text));
        }
    )*};
}

says! {
    unknown_node_type: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Adder, in: {of: x}}
  b: {node: Blur, in: {of: x}}
outputs: {y: a.sum, z: b.sum}
";
    unknown_input_port: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Choose, in: {a: x, bb: x, q: x}, with: {when: never}}
outputs: {y: a.chosen}
";
    unknown_output_port: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}}
  b: {node: Add, in: {of: a.som}}
outputs: {y: b.total}
";
    unknown_source: "gear: 1
inputs: {painting: Number}
nodes:
  first: {node: Add, in: {of: panting}}
  second: {node: Add, in: {of: frist.sum}}
  third: {node: Add, in: {of: second}}
  fourth: {node: Add, in: {of: painting.sum}}
outputs: {y: third.sum, z: fourth.sum, w: nowhere.at_all}
";
    unknown_parameter: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}, with: {pluss: 1}}
  b: {node: Floor, in: {x: a.sum}, with: {anything: 1}}
outputs: {y: b.whole}
";
    unknown_key: "gear: 1
input: {x: Number}
inputs: {x: {type: Number, optonal: true}}
nodes:
  a: {type: Add, node: Add, in: {of: x}, wiht: {plus: 1}}
outputs: {y: a.sum}
";
    wrong_port_type: "gear: 1
inputs: {x: Number, r: Report}
nodes:
  a: {node: Measure, in: {report: x}}
  b: {node: Floor, in: {x: [x, x]}}
outputs: {y: a.length, z: b.whole}
";
    missing_input: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Choose, in: {a: x}}
outputs: {y: a.chosen}
";
    optional_into_required: "gear: 1
inputs: {x: {type: Number, optional: true}}
nodes:
  a: {node: Floor, in: {x: x}}
outputs: {y: a.whole}
";
    unused_is_a_warning: "gear: 1
inputs: {x: Number, spare: Number}
nodes:
  a: {node: Add, in: {of: x}}
  b: {node: Add, in: {of: a.sum}}
outputs: {y: a.sum}
";
    cycle: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: [x, c.sum]}}
  b: {node: Add, in: {of: a.sum}}
  c: {node: Add, in: {of: b.sum}}
  alone: {node: Add, in: {of: alone.sum}}
outputs: {y: c.sum, z: alone.sum}
";
    wrong_parameter_type: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}, with: {plus: much}}
  b: {node: Choose, in: {a: x, b: x}, with: {when: [never]}}
  c: {node: Add, in: {of: x}, with: 3}
outputs: {y: a.sum, z: b.chosen, w: c.sum}
";
    parameter_out_of_range: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Ranged, in: {x: x}, with: {share: 1.5, count: -1, list: [0, 200, .inf], auto: 3}}
  b: {node: Ranged, in: {x: x}, with: {share: .nan, low: 2}}
outputs: {y: a.whole, z: b.whole}
";
    unknown_choice: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Choose, in: {a: x, b: x}, with: {when: nevr}}
  b: {node: Choose, in: {a: x, b: x}, with: {when: {above: {treshold: 1}}}}
outputs: {y: a.chosen, z: b.chosen}
";
    duplicate_key: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}}
  a: {node: Add, in: {of: x}, with: {plus: 1, plus: 2}}
outputs: {y: a.sum}
";
    version_too_new: "inputs: {x: Number, x: Number, y: Strange}
nodes: {a: {node: New, over: there}}
gear: 2
";
    words_and_empty_maps: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Ranged, in: {x: x}, with: {auto: Auto, share: {}, list: {}}}
outputs: {y: a.whole}
";
    missing_version_and_outputs: "inputs: {x: Number}
nodes: {a: {node: Add, in: {of: x}}}
";
    yaml_1_1_traps: "gear: 1
inputs: {x: {type: Number, optional: no}}
nodes:
  a: {node: Add, in: {of: x}, with: {plus: 012}}
  b: {node: Add, in: {of: x}, with: {plus: 1_000}}
  c: {node: Add, in: {of: x}, with: {plus: '3'}}
  d: {node: Ranged, in: {x: x}, with: {flag: yes}}
outputs: {y: a.sum, z: b.sum, w: c.sum, v: d.whole}
";
    not_yaml: "gear: 1
inputs: {x: Number
nodes: ]
";
    not_a_map: "- gear
- 1
";
    alias_bomb: "gear: 1
inputs:
  a: &a [x, x, x, x, x, x, x, x, x, x]
  b: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a, *a]
  c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b, *b]
  d: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c, *c]
  e: &e [*d, *d, *d, *d, *d, *d, *d, *d, *d, *d]
  f: &f [*e, *e, *e, *e, *e, *e, *e, *e, *e, *e]
  g: &g [*f, *f, *f, *f, *f, *f, *f, *f, *f, *f]
";
    names: "gear: 1
inputs: {x: Number, 1st: Number}
nodes:
  x: {node: Add, in: {of: x}}
  a.b: {node: Add, in: {of: x}}
outputs: {y: x.sum}
";
    output_names: "gear: 1
inputs: {x: Number, _x: Number}
nodes:
  a: {node: Add, in: {of: [x, _x]}}
outputs:
  ../../evil: a.sum
  /tmp/evil: a.sum
  '': a.sum
  report: a.sum
  Run: a.sum
  sum: a.sum
  Sum: a.sum
";
    input_types: "gear: 1
inputs: {x: Numbr, y: {optional: true}, z: {type: Number, with: {scal: 2}}, r: {type: Report, with: {size: 2}}}
nodes: {a: {node: Add, in: {of: [x, y, z]}}}
outputs: {y: a.sum}
";
    everything_in_one_pass: "gear: 1
inputs: {x: Nummer}
nodes:
  a: {node: Ad, in: {of: x}}
  b: {node: Add, in: {off: x}, with: {plus: lots}}
  c: {node: Add, in: {of: d.sum}}
  d: {node: Add, in: {of: c.sum}}
outputs: {y: b.summ}
";
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
    insta::assert_snapshot!(mistakes_set(
        text,
        &[
            "a.pluss=1",
            "a.plus=much",
            "b.plus=1",
            "xx.scale=2",
            "a.plus",
            "plus=1",
            "x.scale=[",
            "c.when.above.treshold=3",
        ]
    ));
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
        let said = mistakes(&text);
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
