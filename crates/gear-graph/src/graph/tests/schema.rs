//! The schema says what the check says, as far as a schema can.

use boon::{Compiler, Schemas};
use serde_json::Value;

use super::*;
use crate::graph::{CAUSES, schema, yaml};

/// Judges files by the schema.
struct Judge {
    schemas: Schemas,
    index: boon::SchemaIndex,
}

impl Judge {
    fn new() -> Self {
        let mut schemas = Schemas::new();
        let mut compiler = Compiler::new();
        compiler
            .add_resource("https://example.org/graph.json", schema(&registry()))
            .unwrap();
        let index = compiler
            .compile("https://example.org/graph.json", &mut schemas)
            .unwrap();
        Self { schemas, index }
    }

    fn objects(&self, file: &Value) -> Option<String> {
        let result = self.schemas.validate(file, self.index);
        result.err().map(|error| format!("{error:#}"))
    }
}

/// The file as JSON, if it is YAML. Of keys that repeat the last one counts.
fn json(text: &str) -> Option<Value> {
    fn value(tree: &Tree) -> Value {
        match &tree.kind {
            TreeKind::Null => Value::Null,
            TreeKind::Bool(b) => (*b).into(),
            TreeKind::Integer(i) => (*i).into(),
            TreeKind::Float(f) => (*f).into(),
            TreeKind::Text(text) => text.as_str().into(),
            TreeKind::List(items) => items.iter().map(value).collect(),
            TreeKind::Map(entries) => entries
                .iter()
                .map(|(key, tree)| (key.value.clone(), value(tree)))
                .collect(),
        }
    }
    yaml::parse(text, 0, &mut Vec::new()).as_ref().map(value)
}

#[test]
fn the_schema_is_complete() {
    insta::assert_json_snapshot!(schema(&registry()));
}

#[test]
fn a_mistake_that_a_schema_can_express_is_an_error_of_the_schema_and_no_other() {
    let judge = Judge::new();
    for (name, text) in causes::CASES {
        let Some(file) = json(text) else {
            continue;
        };
        let mistakes = mistakes(text);
        let by_schema = |problem: &&Problem| CAUSES.iter().any(|cause| cause.code == problem.code && cause.schema);
        let expected = mistakes.problems().iter().find(by_schema);
        let found = judge.objects(&file);
        assert_eq!(
            expected.is_some(),
            found.is_some(),
            "{name}: {expected:?} {found:?}\n{text}"
        );
    }
}

#[test]
fn each_of_these_causes_is_expressed_on_its_own() {
    let judge = Judge::new();
    let mut alone: Vec<_> = CAUSES
        .iter()
        .filter(|cause| cause.schema)
        .map(|cause| cause.code)
        .collect();
    let good = "gear: 1
inputs: {x: Number, y: {type: Number, optional: true, with: {scale: 2}}, r: Report}
nodes:
  add: {node: Add, in: {of: [x, y]}, with: {plus: 1.5}}
  one: {node: Add, in: {of: x}}
  choose: {node: Choose, in: {a: x, b: x}, with: {when: {above: {threshold: 2}}}}
  never: {node: Choose, in: {a: x, b: x}, with: {when: never}}
  sized: {node: Sized, in: {x: x}, with: {size: 4, box: null}}
  boxed: {node: Sized, in: {x: x}, with: {size: 4, box: [0, 0, 1, 1]}}
  ranged: {node: Ranged, in: {x: x}, with: {share: 0.5, auto: auto, list: [-90, 90]}}
  measured: {node: Measure, in: {report: r}, with: {plus: 2}}
outputs: {s: add.sum, o: one.sum, c: choose.chosen, n: never.chosen, z: sized.whole, b: boxed.whole, w: ranged.whole, r: r, m: measured.length}
snapshots: {short: add.sum, long: {port: one.sum, norm: relative, tolerance: 0.5, size: 16}}
";
    assert_eq!(mistakes(good).problems(), []);
    assert_eq!(judge.objects(&json(good).unwrap()), None);
    for (code, from, to) in [
        ("unknown-key", "optional: true", "optonal: true"),
        ("unknown-value-type", "r: Report", "r: Reprot"),
        ("unknown-node-type", "node: Ranged", "node: Rangde"),
        ("unknown-port", "in: {of: x}", "in: {of: x, off: x}"),
        ("unknown-parameter", "auto: auto", "autto: auto"),
        ("unknown-choice", "when: never", "when: nevr"),
        ("unknown-choice", "above:", "abov:"),
        ("wrong-type", "in: {of: x}", "in: {of: 3}"),
        ("wrong-type", "optional: true", "optional: no"),
        ("wrong-type", "{a: x, b: x}", "{a: [x], b: x}"),
        ("wrong-type", "{node: Add, in: {of: x}}", "Add"),
        ("wrong-parameter-type", "plus: 1.5", "plus: 012"),
        ("wrong-parameter-type", "plus: 1.5", "plus: yes"),
        ("wrong-parameter-type", "auto: auto", "auto: automatic"),
        ("wrong-parameter-type", "[0, 0, 1, 1]", "[0, 0, 1]"),
        ("wrong-parameter-type", "scale: 2", "scale: {}"),
        ("parameter-out-of-range", "share: 0.5", "share: 1.5"),
        ("parameter-out-of-range", "[-90, 90]", "[-90, 91]"),
        // Without a range of its own, an unsigned number has that of its type.
        ("parameter-out-of-range", "plus: 2", "plus: -1"),
        ("parameter-out-of-range", "plus: 2", "plus: 4294967296"),
        ("parameter-out-of-range", "size: 4, box: null", "size: 0"),
        ("parameter-out-of-range", "auto: auto", "auto: 1"),
        ("missing-input", "{a: x, b: x}", "{a: x}"),
        ("missing-input", "in: {x: x}, ", ""),
        ("missing-parameter", "size: 4, ", ""),
        ("missing-type", "type: Number, ", ""),
        ("missing-node-type", "node: Ranged, ", ""),
        ("missing-port", "port: one.sum, ", ""),
        ("unknown-key", "tolerance:", "tolerence:"),
        ("unknown-choice", "norm: relative", "norm: relativ"),
        ("wrong-type", "tolerance: 0.5", "tolerance: some"),
        ("parameter-out-of-range", "tolerance: 0.5", "tolerance: -0.5"),
        ("parameter-out-of-range", "size: 16", "size: 0"),
        ("bad-name", "short:", "sh.ort:"),
        ("missing-version", "gear: 1", ""),
        ("bad-version", "gear: 1", "gear: one"),
        ("version-too-new", "gear: 1", "gear: 2"),
        ("no-outputs", "outputs:", "# outputs:"),
        ("bad-name", "ranged:", "1ranged:"),
        ("bad-name", "ranged:", "ran.ged:"),
        ("reserved-name", "{s: ", "{rUn: "),
    ] {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let codes: Vec<_> = mistakes(&text).problems().iter().map(|problem| problem.code).collect();
        assert!(codes.contains(&code), "{code}: {codes:?}\n{text}");
        assert!(judge.objects(&json(&text).unwrap()).is_some(), "{code}\n{text}");
        alone.retain(|other| *other != code);
    }
    assert_eq!(alone, [""; 0], "causes without an example");
}

#[test]
fn a_graph_over_another_may_leave_out_and_remove() {
    let judge = Judge::new();
    let over = "gear: 1
extends: '@gear'
inputs: {x: {with: {scale: 3}}, y: null}
nodes:
  first: null
  second: {in: {of: null}, with: {plus: null}}
  third: {node: Choose, in: {b: null}, with: {when: {above: {threshold: null}}}}
outputs: {z: null}
";
    assert_eq!(judge.objects(&json(over).unwrap()), None);
    for (from, to) in [
        ("node: Choose", "node: Chose"),
        ("{b: null}", "{d: x}"),
        ("threshold: null", "treshold: null"),
        ("first: null", "first: 3"),
        ("extends: '@gear'", "extends: [gear]"),
        ("extends: '@gear'", ""),
    ] {
        let text = over.replacen(from, to, 1);
        assert_ne!(text, over, "{from}");
        assert!(judge.objects(&json(&text).unwrap()).is_some(), "{text}");
    }
}
