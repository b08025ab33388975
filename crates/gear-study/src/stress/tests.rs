//! The catalogue and its judgement, on nodes of the tests' own.

use std::sync::Arc;

use gear_graph::{Context, Inputs, Node, NodeError, Outputs, Params, Registry, Want};
use gear_image::{Field, Image};

use super::*;

/// Scales a field; what it does otherwise is said by its mood.
#[derive(Clone, Debug, Params)]
struct Moody {
    #[param(default = 1.0)]
    factor: f64,
    #[param(default = 0, range = 0..=3)]
    mood: u32,
}

#[derive(Inputs)]
struct In {
    field: Arc<Field>,
}

#[derive(Outputs)]
struct Out {
    field: Arc<Field>,
}

impl Node for Moody {
    const NAME: &str = "Moody";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        let mut field = (*inputs.field).clone();
        for x in field.data_mut() {
            *x = if x.is_finite() {
                (f64::from(*x) * self.factor) as f32
            } else {
                0.0
            };
        }
        match self.mood {
            0 => Ok(()),
            1 => Err(NodeError::input("field", "not today")),
            2 => panic!("never again"),
            _ => {
                field.data_mut()[0] = f32::INFINITY;
                Ok(())
            }
        }?;
        Ok(Out { field: Arc::new(field) })
    }
}

fn registry() -> Registry {
    let mut registry = Registry::new();
    gear_image::register(&mut registry);
    gear_splat::register(&mut registry);
    registry.node::<Moody>();
    registry
}

const TEXT: &str = "
catalogue: 1
ordinary: {Field: field/one}
nodes: {Moody: {refuses: {field: [field/two]}}}
values:
  - {name: field/one, why: all 1, make: {field: {size: [3, 2], fill: {constant: 1}}}}
  - {name: field/two, why: all 2, make: {field: {size: [3, 2], fill: {constant: 2}}}}
cases:
  - {name: range, node: Moody, in: {field: field/two}, expect: {outputs: {field: {range: [2, 2]}}}}
  - {name: same, node: Moody, in: {field: field/two}, expect: {outputs: {field: {same_as: field}}}}
  - {name: near, node: Moody, with: {factor: 1.01}, in: {field: field/two}, expect: {outputs: {field: {same_as: field, within: 0.02}}}}
  - {name: no number, node: Moody, nan: [factor], in: {field: field/two}, expect: {refused: factor}}
  - {name: refused, node: Moody, with: {mood: 9}, in: {field: field/two}, expect: {refused: mood}}
";

fn catalogue(text: &str) -> Catalogue {
    Catalogue::read(text, &registry()).unwrap()
}

fn swept(mood: u32) -> Vec<Row> {
    let registry = registry();
    let node = registry.find_node("Moody").unwrap();
    let with = serde_json::json!({"mood": mood});
    let with = with.as_object().unwrap();
    stress_node(&catalogue(TEXT), node, with, &Options::default(), &mut |_| {}).unwrap()
}

fn surprise<'r>(rows: &'r [Row], case: &str) -> Option<&'r str> {
    rows.iter().find(|row| row.case == case).unwrap().surprise.as_deref()
}

#[test]
fn an_answer_where_a_refusal_is_expected_is_a_surprise_and_the_other_way_round() {
    let rows = swept(0);
    assert_eq!(surprise(&rows, "field = field/one"), None);
    assert!(
        surprise(&rows, "field = field/two")
            .unwrap()
            .contains("expected an error")
    );
    assert!(rows.len() > 6, "the extremes that the type declares are there as well");
    let rows = swept(1);
    assert!(surprise(&rows, "field = field/one").unwrap().contains("not today"));
    assert_eq!(surprise(&rows, "field = field/two"), None);
}

#[test]
fn a_panic_and_a_flaw_are_always_surprises() {
    for (mood, word) in [(2, "never again"), (3, "infinite")] {
        for row in swept(mood) {
            assert_eq!(row.outcome, Outcome::Breaks, "{row:?}");
            assert!(row.surprise.unwrap().contains(word));
        }
    }
}

#[test]
fn a_case_is_held_to_what_it_says() {
    let run = |text: &str| {
        let (catalogue, registry) = (catalogue(text), registry());
        let cases = catalogue.cases.clone();
        let rows = cases
            .iter()
            .map(|case| stress_case(&catalogue, case, &registry, &Options::default()));
        rows.map(|row| (row.case, row.surprise)).collect::<Vec<_>>()
    };
    for (case, surprise) in run(TEXT) {
        assert_eq!(surprise, None, "{case}");
    }
    let wrong = TEXT
        .replace("range: [2, 2]", "range: [0, 1]")
        .replace("{same_as: field}", "{same_as: nothing}")
        .replace("within: 0.02", "within: 0.001")
        .replace("expect: {refused: factor}", "expect: {refused: nothing}")
        .replace("refused: mood", "refused: factor");
    for (case, surprise) in run(&wrong) {
        assert!(surprise.is_some(), "{case}");
    }
}

#[test]
fn a_catalogue_with_a_name_that_does_not_exist_is_refused() {
    for (from, to) in [
        ("{Field: field/one}", "{Field: field/three}"),
        ("[field/two]", "[field/thr*]"),
        ("in: {field: field/two}", "in: {field: field/four}"),
        ("catalogue: 1", "catalogue: 2"),
        ("size: [3, 2]", "size: [0, 2]"),
        ("why: all 1,", "whyy: all 1,"),
    ] {
        let text = TEXT.replace(from, to);
        assert!(Catalogue::read(&text, &registry()).is_err(), "{to}");
    }
}

#[test]
fn the_shipped_catalogue_names_every_extreme_that_the_types_of_rasters_and_scenes_declare() {
    let registry = registry();
    let catalogue = Catalogue::shipped(&registry).unwrap();
    let unnamed: Vec<_> = catalogue
        .values
        .iter()
        .filter(|named| named.why == "declared by its type")
        .map(|named| named.name.as_str())
        .collect();
    assert!(
        unnamed
            .iter()
            .all(|name| name.starts_with("number/") || name.starts_with("report/")),
        "{unnamed:?}"
    );
    assert!(catalogue.values.len() > 60 && catalogue.cases.len() > 40);
    let mut names: Vec<_> = catalogue.values.iter().map(|named| &named.name).collect();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), catalogue.values.len(), "each name once");
}

#[test]
fn a_graph_is_fed_every_value_of_its_inputs() {
    let registry = registry();
    let text = "gear: 1\ninputs: {f: Field}\nnodes:\n  a: {node: Moody, in: {field: f}}\n  \
                b: {node: Moody, in: {field: a.field}, with: {mood: 2}}\noutputs: {f: b.field}\n";
    let graph = gear_graph::GraphSource::new("g", text).check(&registry).unwrap();
    let catalogue = catalogue(TEXT);
    let fields = catalogue
        .values
        .iter()
        .filter(|named| named.value.get::<Field>().is_some())
        .count();
    let rows = stress_graph(&catalogue, &graph, &Options::default(), &|run| run, &mut |_| {});
    assert_eq!(rows.len(), 2 * fields);
    for row in rows {
        let expected = if row.node == "a" {
            Outcome::Answers
        } else {
            Outcome::Breaks
        };
        assert_eq!(row.outcome, expected, "{row:?}");
        assert_eq!(row.surprise.is_some(), row.node == "b");
    }
    assert!(
        catalogue
            .values
            .iter()
            .any(|named| named.value.get::<Image>().is_some())
    );
}
