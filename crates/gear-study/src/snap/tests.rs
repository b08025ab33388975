//! The whole way: a graph, a run, what is pinned, what is told.

use std::sync::Arc;

use gear_graph::{Context, GraphSource, Inputs, Node, NodeError, Outputs, Params, Registry, Report, Run, Want};
use gear_image::{Field, Image, SrgbImage};
use serde_json::json;

use super::*;

/// A picture and what can be said of it.
#[derive(Clone, Debug, Params)]
struct Paint {
    #[param(default = 0.5)]
    grey: f64,
    #[param(default = 64, range = 1..=256)]
    side: usize,
}

#[derive(Inputs)]
struct In {
    field: Arc<Field>,
}

#[derive(Outputs)]
struct Out {
    image: Arc<Image>,
    report: Arc<Report>,
}

impl Node for Paint {
    const NAME: &str = "Paint";
    const VERSION: u32 = 1;
    type Inputs = In;
    type Outputs = Out;

    fn run(&self, inputs: In, _want: &Want, _ctx: &Context) -> Result<Out, NodeError> {
        if self.grey < 0.0 {
            return Err(NodeError::new("no light is negative"));
        }
        let grey = self.grey as f32 + inputs.field.data()[0];
        let image = SrgbImage::from_fn(self.side, self.side, |x, _| [grey, x as f32 / self.side as f32, 0.0]);
        Ok(Out {
            image: Arc::new(Image::opaque(image)),
            report: Arc::new(Report(serde_json::json!({"grey": grey, "name": "paint"}))),
        })
    }
}

struct Bench {
    folder: tempfile::TempDir,
    registry: Registry,
}

impl Bench {
    fn new() -> Self {
        let mut registry = Registry::new();
        gear_image::register(&mut registry);
        gear_splat::register(&mut registry);
        registry.node::<Paint>();
        Self {
            folder: tempfile::tempdir().unwrap(),
            registry,
        }
    }

    /// Runs a graph with these parameters and snapshots, given an input that people call `given`.
    fn run(&self, params: &str, snapshots: &str, given: &str) -> Comparison {
        let text = format!(
            "gear: 1\ninputs: {{field: Field}}\nnodes: {{paint: {{node: Paint, in: {{field: field}}, with: {params}}}}}\n\
             outputs: {{image: paint.image}}\nsnapshots: {snapshots}\n"
        );
        let graph = GraphSource::new("g.yaml", text)
            .check(&self.registry)
            .unwrap()
            .into_snapshots();
        let outcome = Run::new(&graph)
            .input_value("field", Field::filled(1, 1, 0.0))
            .go()
            .unwrap();
        let inputs = BTreeMap::from([("field".to_owned(), given.to_owned())]);
        compare(&graph, &outcome, self.folder.path(), &inputs).unwrap()
    }

    fn accept(&self, comparison: &Comparison) -> usize {
        let names = comparison.snapshots.iter().map(|s| s.name.clone()).collect();
        accept(comparison, self.folder.path(), &names).unwrap().len()
    }
}

const SNAPSHOTS: &str =
    "{image: {port: paint.image, norm: max, tolerance: 0.01}, words: {port: paint.report, norm: max, tolerance: 0.01}}";

fn states(comparison: &Comparison) -> Vec<String> {
    comparison
        .snapshots
        .iter()
        .map(|s| line(s).split_whitespace().nth(1).unwrap().to_owned())
        .collect()
}

#[test]
fn what_is_missing_is_told_and_what_is_pinned_is_the_same_again() {
    let bench = Bench::new();
    let first = bench.run("{}", SNAPSHOTS, "a");
    assert_eq!(states(&first), ["MISSING", "MISSING"]);
    assert!(first.snapshots.iter().all(|s| !s.state.passes()));
    assert_eq!(bench.accept(&first), 4, "two records, a raster and a picture");
    assert_eq!(states(&bench.run("{}", SNAPSHOTS, "a")), ["same", "same"]);
    assert_eq!(pinned_inputs(bench.folder.path()).unwrap()["field"], "a");
}

#[test]
fn a_value_moves_within_its_tolerance_or_beyond_it() {
    let bench = Bench::new();
    bench.accept(&bench.run("{}", SNAPSHOTS, "a"));
    let near = bench.run("{grey: 0.505}", SNAPSHOTS, "a");
    assert_eq!(states(&near), ["within", "within"]);
    let far = bench.run("{grey: 0.52}", SNAPSHOTS, "a");
    assert_eq!(states(&far), ["MOVED", "MOVED"]);
    let State::Moved(distance) = far.snapshots[0].state else {
        panic!()
    };
    assert!((distance - 0.02).abs() < 1e-6);
    assert_eq!(far.snapshots[1].numbers[0].path, "grey");
    let html = page("g.yaml", &far).unwrap();
    assert!(
        html.matches("data:image/png").count() == 3,
        "before, after and difference"
    );
    assert!(html.contains("0 of 2 are as they were pinned") && html.contains("<code>grey</code>"));
    bench.accept(&far);
    assert_eq!(states(&bench.run("{grey: 0.52}", SNAPSHOTS, "a")), ["same", "same"]);
}

#[test]
fn another_shape_is_no_small_move() {
    let bench = Bench::new();
    bench.accept(&bench.run("{side: 32}", SNAPSHOTS, "a"));
    let other = bench.run("{side: 16}", SNAPSHOTS, "a");
    assert!(matches!(&other.snapshots[0].state, State::Reshaped(what) if what == "32×32 became 16×16"));
}

#[test]
fn what_was_pinned_from_something_else_is_stale() {
    let bench = Bench::new();
    bench.accept(&bench.run("{}", SNAPSHOTS, "a"));
    assert_eq!(states(&bench.run("{}", SNAPSHOTS, "b")), ["STALE", "STALE"]);
    let other_port = "{image: {port: paint.report}, words: {port: paint.report, norm: max, tolerance: 0.01}}";
    assert_eq!(states(&bench.run("{}", other_port, "a")), ["STALE", "same"]);
    let other_size = SNAPSHOTS.replacen("tolerance: 0.01", "tolerance: 0.01, size: 7", 1);
    assert_eq!(states(&bench.run("{}", &other_size, "a")), ["STALE", "same"]);
    std::fs::write(bench.folder.path().join("image.json"), "no JSON").unwrap();
    assert_eq!(states(&bench.run("{}", SNAPSHOTS, "a")), ["STALE", "same"]);
}

#[test]
fn another_tolerance_needs_no_new_snapshot() {
    let bench = Bench::new();
    bench.accept(&bench.run("{}", SNAPSHOTS, "a"));
    let wide = SNAPSHOTS.replace("tolerance: 0.01", "tolerance: 0.1");
    assert_eq!(states(&bench.run("{grey: 0.55}", &wide, "a")), ["within", "within"]);
}

#[test]
fn a_pinned_file_that_the_graph_does_not_have_is_told_and_forgotten_on_demand() {
    let bench = Bench::new();
    bench.accept(&bench.run("{}", SNAPSHOTS, "a"));
    let fewer = bench.run("{}", "{words: {port: paint.report, norm: max}}", "a");
    assert_eq!(fewer.unknown, ["image"]);
    assert!(
        page("g", &fewer)
            .unwrap()
            .contains("<code>image</code>, which the graph does not have")
    );
    forget(bench.folder.path(), "image").unwrap();
    assert!(bench.run("{}", "{words: paint.report}", "a").unknown.is_empty());
    assert_eq!(std::fs::read_dir(bench.folder.path()).unwrap().count(), 1);
}

#[test]
fn a_node_that_fails_fails_its_snapshots() {
    let bench = Bench::new();
    bench.accept(&bench.run("{}", SNAPSHOTS, "a"));
    assert_eq!(states(&bench.run("{grey: -1}", SNAPSHOTS, "a")), ["FAILED", "FAILED"]);
}

#[test]
fn snapshots_that_were_made_from_different_inputs_are_refused() {
    let bench = Bench::new();
    let of = |given| bench.run("{}", SNAPSHOTS, given);
    bench.accept(&of("a"));
    let other = of("b");
    accept(&other, bench.folder.path(), &BTreeSet::from(["words".to_owned()])).unwrap();
    assert!(
        pinned_inputs(bench.folder.path())
            .unwrap_err()
            .to_string()
            .contains("`field` is a and b")
    );
}

#[test]
fn numbers_that_moved_most_are_told_first_and_rounded() {
    let number = |path: &str, before: serde_json::Value, after: serde_json::Value| compare::Number {
        path: path.to_owned(),
        before,
        after,
    };
    let numbers = [
        number("little", json!(0.123456789), json!(0.123456999)),
        number("more", json!(12.345678901), json!(2)),
        number("word", json!("a"), json!("b")),
        number("some", json!(1), json!(2)),
    ];
    assert_eq!(
        moved_most(&numbers, 3),
        ["word: \"a\" → \"b\"", "more: 12.346 → 2", "some: 1 → 2", "… and 1 more"]
    );
    assert_eq!(moved_most(&numbers[..1], 3), ["little: 0.1234568 → 0.123457"]);
}
