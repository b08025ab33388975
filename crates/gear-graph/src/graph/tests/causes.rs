//! Every cause of a mistake, with the exact text that people read.
//!
//! The snapshots beside this file are the reference of what gear says.

use std::collections::BTreeSet;

use super::*;
use crate::graph::CAUSES;

/// A test and a snapshot for each graph file.
macro_rules! says {
    ($($name:ident: $text:expr;)*) => {
        $(
            #[test]
            fn $name() {
                insta::assert_snapshot!(mistakes($text));
            }
        )*

        /// The files, by name.
        pub const CASES: &[(&str, &str)] = &[$((stringify!($name), $text)),*];
    };
}

#[test]
fn every_cause_has_a_case_and_every_case_a_listed_cause() {
    let mut found = BTreeSet::new();
    for (_, text) in CASES {
        found.extend(mistakes(text).problems().iter().map(|problem| problem.code));
    }
    for files in overlays::MISTAKES {
        found.extend(overlays::mistakes(files).problems().iter().map(|problem| problem.code));
    }
    found.extend(["bad-override", "unknown-override"]); // `overrides_get_the_same_messages`
    found.extend(["no-loader"]); // `an_input_that_no_file_can_be_given_for`
    let listed: BTreeSet<_> = CAUSES.iter().map(|cause| cause.code).collect();
    assert_eq!(found, listed);
    assert_eq!(listed.len(), CAUSES.len(), "each once");
}

/// A program may give it as a value; who gives files only never can.
#[test]
fn an_input_that_no_file_can_be_given_for() {
    let text = "gear: 1
inputs: {r: Report, s: {type: Report, optional: true}, x: Number}
nodes: {m: {node: Measure, in: {report: r}}}
outputs: {y: m.length, x: x}
";
    let source = GraphSource::new("test.yaml", text);
    assert!(source.check(&registry()).is_ok());
    insta::assert_snapshot!(source.check_for_files(&registry()).unwrap_err());
}

/// To a schema `1.0` is 1.
#[test]
fn a_version_with_a_point_is_shown_with_it() {
    let told = mistakes("gear: 1.0\ninputs: {x: Number}\noutputs: {y: x}\n").render(false);
    assert!(
        told.contains("found `1.0`") && told.contains("write `gear: 1`"),
        "{told}"
    );
}

#[test]
fn the_guide_lists_every_cause() {
    let guide = include_str!("../../../../../docs/src/graphs.md");
    for cause in CAUSES {
        let row = format!("| `{}` | {} |", cause.code, cause.meaning);
        assert!(guide.contains(&row), "{row}");
    }
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
    optional_output: "gear: 1
inputs: {x: {type: Number, optional: true}, y: Number}
outputs: {x: x, y: y}
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
    loops_that_share_a_node: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: [x, b.sum]}}
  b: {node: Add, in: {of: [a.sum, c.sum]}}
  c: {node: Add, in: {of: [b.sum, d.sum]}}
  d: {node: Add, in: {of: c.sum}}
outputs: {y: d.sum}
";
    an_output_of_an_unknown_type: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Blur, in: {of: x}}
outputs: {y: a}
";
    keys_of_other_programs: "gear: 1
inputs: {x: {kind: Number}}
nodes:
  a: {node: Add, inputs: {of: x}, params: {plus: 1}}
  b: {node: Add, in: {of: x, with: {plus: 1}}}
  c: {type: Add, in: {of: x}}
outputs: {y: a.sum, z: b.sum, w: c.sum}
";
    missing_node_type: "gear: 1
inputs: {x: Number}
nodes:
  a: {in: {of: x}}
outputs: {y: x}
";
    colon_without_space: "gear: 1
inputs: {x: Number}
nodes:
  a: {node:Add, in: {of: x}}
  b: {node: Add, in: {of:x}, with: {plus:1}}
  c: {node: Choose, in: {a: x, b: x}, with: {when: above:1}}
outputs: {y: x, z:b.sum}
";

    missing_parameter: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Sized, in: {x: x}}
outputs: {y: a.whole}
";
    nothing_given: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Sized, in: {x: x}, with: {size: , box: }}
outputs: {y: a.whole}
";
    parameters_do_not_fit: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Ranged, in: {x: x}, with: {low: 2}}
outputs: {y: a.whole}
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
    bad_version: "gear: one
inputs: {x: Number}
outputs: {y: x}
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
    numbers_of_other_habits: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}, with: {plus: 1:30}}
  b: {node: Add, in: {of: x}, with: {plus: '0,5'}}
outputs: {y: a.sum, z: b.sum}
";
    two_documents: "gear: 1
inputs: {x: Number}
outputs: {y: x}
---
gear: 1
";
    key_that_is_no_text: "gear: 1
[a, b]: c
";
    at_sign_without_quotes: "gear: 1
extends: @gear
";
    unknown_anchor: "gear: 1
inputs: {x: *number}
";
    tab_that_indents: "gear: 1
inputs:
\tx: Number
outputs: {y: x}
";
    too_deep: "gear: 1
inputs: [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]
";
    characters_that_move_the_cursor: "gear: 1
inputs: {x: \"Num\\e[31mber\", y: \u{202e}Number}
outputs: {y: x}
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
    snapshots: "gear: 1
inputs: {x: Number}
nodes:
  a: {node: Add, in: {of: x}}
outputs: {y: a.sum}
snapshots:
  good: {port: a.sum, norm: max, tolerance: 0.5, size: 12}
  lost: {norm: rms}
  wrong: {port: a.som, norm: rsm, tolerance: -1, size: 1000, tolerence: 2}
  odd: {port: x, norm: 3, tolerance: much, size: 1.5}
  Good: a.sum
  1st: a.sum
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
