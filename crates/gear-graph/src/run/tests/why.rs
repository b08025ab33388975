//! What is told of why something runs, and of where it came from.

use super::kit::*;
use crate::*;

const BODY: &str = "inputs: {x: Number}
nodes:
  first: {node: Add, in: {of: x}, with: {plus: 1}}
  floor: {node: Floor, in: {x: first.sum}}
  choose: {node: Choose, in: {a: floor.whole, b: floor.rest}, with: {when: {above: {threshold: 3}}}}
  last: {node: Add, in: {of: [choose.chosen, floor.whole]}}
outputs: {y: last.sum, twice: choose.twice}";

fn graph_of(set: &[&str]) -> Graph {
    graph_set(BODY, set)
}

fn setting<'g>(graph: &'g Graph, shelf: &Shelf, x: f64) -> Run<'g> {
    Run::new(graph).store(shelf.open()).input_value("x", Number(x))
}

/// Runs and forgets.
fn ran(shelf: &Shelf, set: &[&str], x: f64) {
    setting(&graph_of(set), shelf, x).go().unwrap();
}

/// The explanation, with what changes from run to run made plain.
fn told(run: &Run<'_>, name: &str) -> String {
    let mut whys = run.why(name).unwrap();
    for why in &mut whys {
        for run in [&mut why.computed, &mut why.nearest].into_iter().flatten() {
            (run.run, run.made, run.seconds) = ("RUN".to_string(), 1_795_437_882, 0.0);
        }
    }
    let all: Vec<_> = whys.iter().map(ToString::to_string).collect();
    all.join("\n")
}

fn why(shelf: &Shelf, set: &[&str], x: f64, name: &str) -> String {
    told(&setting(&graph_of(set), shelf, x), name)
}

#[test]
fn a_node_that_never_ran() {
    insta::assert_snapshot!(why(&Shelf::new(), &[], 1.5, "first"));
}

#[test]
fn a_parameter_that_changed() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    insta::assert_snapshot!(why(&shelf, &["first.plus=2"], 1.5, "first.sum"));
}

#[test]
fn a_choice_that_changed() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    insta::assert_snapshot!(why(&shelf, &["choose.when=never"], 1.5, "choose"));
}

#[test]
fn an_input_whose_content_changed() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    insta::assert_snapshot!(why(&shelf, &[], 1.75, "first"));
}

#[test]
fn an_input_that_is_known_only_when_another_node_has_run() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    insta::assert_snapshot!(why(&shelf, &["first.plus=2"], 1.5, "last"));
}

#[test]
fn a_value_that_is_stored_tells_its_run_and_why_that_run_computed_it() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    ran(&shelf, &["first.plus=2.75"], 1.5);
    let text = why(&shelf, &["first.plus=2.75"], 1.5, "floor");
    insta::assert_snapshot!(text);
}

#[test]
fn a_lazy_input_that_was_not_asked_for_before() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    // The threshold is passed: `rest` is asked for.
    ran(&shelf, &[], 7.5);
    insta::assert_snapshot!(why(&shelf, &[], 7.5, "choose.chosen"));
}

/// What was asked for before is not said to be asked for no more, as long as nobody knows.
#[test]
fn a_lazy_input_of_which_values_decide_whether_it_is_asked_for() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 7.5);
    insta::assert_snapshot!(why(&shelf, &["first.plus=2"], 7.5, "choose.chosen"));
}

#[test]
fn a_node_that_runs_because_it_was_asked_to() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 7.5);
    let graph = graph_of(&[]);
    let fresh = |node: &str| setting(&graph, &shelf, 7.5).fresh(node);
    let all = [
        told(&fresh("floor"), "floor.whole"),
        told(&fresh("floor"), "last"),
        told(&fresh("choose"), "choose.chosen"),
    ];
    insta::assert_snapshot!(all.join("\n\n"));
}

/// The log of actions was lost, that of origins was not.
#[test]
fn a_node_whose_record_is_lost() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 7.5);
    std::fs::remove_file(shelf.path().join("actions-1.log")).unwrap();
    insta::assert_snapshot!(why(&shelf, &[], 7.5, "last"));
}

#[test]
fn another_node_of_the_type_serves_when_this_one_never_ran() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    let other =
        graph("inputs: {x: Number}\nnodes: {mine: {node: Add, in: {of: x}, with: {plus: 9}}}\noutputs: {y: mine.sum}");
    insta::assert_snapshot!(told(&setting(&other, &shelf, 1.5), "mine"));
}

#[test]
fn the_elision_mode() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    let graph = graph_of(&[]);
    insta::assert_snapshot!(told(&setting(&graph, &shelf, 1.5).no_elision(), "choose.chosen"));
}

#[test]
fn a_file_that_changed() {
    let shelf = Shelf::new();
    let graph = graph_of(&[]);
    let (old, new) = (shelf.path().join("old.txt"), shelf.path().join("new.txt"));
    std::fs::write(&old, "1.5").unwrap();
    std::fs::write(&new, "1.75").unwrap();
    let run = |path: &std::path::Path| Run::new(&graph).store(shelf.open()).input("x", Input::file(path));
    run(&old).go().unwrap();
    let text = told(&run(&new), "x").replace(&shelf.path().display().to_string(), "DIR");
    insta::assert_snapshot!(text);
}

#[test]
fn a_version_and_numerics_that_were_raised() {
    // The same node as `Add`, of a later version, that computes with a crate.
    #[derive(Clone, Debug, Params)]
    struct Later {
        /// Added to the sum.
        #[param(default = 0.0)]
        plus: f64,
    }

    impl Node for Later {
        const NAME: &str = "Add";
        const VERSION: u32 = 2;
        const USES: &'static [Numerics] = &[Numerics::new("sums", 3)];
        type Inputs = AddIn;
        type Outputs = AddOut;

        fn run(&self, inputs: AddIn, want: &Want, ctx: &Context) -> Result<AddOut, NodeError> {
            Add { plus: self.plus }.run(inputs, want, ctx)
        }
    }

    let body = "gear: 1\ninputs: {x: Number}\nnodes: {add: {node: Add, in: {of: x}}}\noutputs: {y: add.sum}";
    let shelf = Shelf::new();
    let graph = GraphSource::new("test.yaml", body).check(&registry()).unwrap();
    setting(&graph, &shelf, 1.0).go().unwrap();
    let mut later = Registry::new();
    later.node::<Later>();
    let graph = GraphSource::new("test.yaml", body).check(&later).unwrap();
    insta::assert_snapshot!(told(&setting(&graph, &shelf, 1.0), "add"));
}

#[test]
fn what_is_left_out_and_what_does_not_exist() {
    let shelf = Shelf::new();
    let graph = graph_of(&["choose.when=never"]);
    let run = setting(&graph, &shelf, 1.5);
    let unknown = |name: &str| run.why(name).unwrap_err()[0].to_string();
    let all = [
        told(&run.clone().outputs(["twice"]), "last"),
        told(&run, "floor.large"),
        told(&run, "x"),
        unknown("flour"),
        unknown("floor.hole"),
    ];
    insta::assert_snapshot!(all.join("\n\n"));
}

#[test]
fn an_origin_that_is_lost_costs_an_explanation_and_nothing_else() {
    let shelf = Shelf::new();
    ran(&shelf, &[], 1.5);
    std::fs::remove_file(shelf.path().join("origins-1.log")).unwrap();
    let warm = setting(&graph_of(&[]), &shelf, 1.5).go().unwrap().report;
    assert_eq!(warm.ran(), [""; 0]);
    assert_eq!(warm.warnings, [""; 0]);
    insta::assert_snapshot!(why(&shelf, &[], 1.5, "first"));
}

#[test]
fn the_nearest_run_is_the_one_that_differs_least_and_then_the_latest() {
    let shelf = Shelf::new();
    for plus in ["1", "2", "3"] {
        ran(&shelf, &[&format!("first.plus={plus}")], 1.5);
    }
    ran(&shelf, &["first.plus=4"], 1.75);
    let old = |x: f64| {
        let graph = graph_of(&["first.plus=5"]);
        let why = setting(&graph, &shelf, x).why("first").unwrap().remove(0);
        assert_eq!(why.differences.len(), 1, "{why}");
        why.differences[0].old.clone().unwrap()
    };
    assert_eq!(old(1.5), "3.0");
    assert_eq!(old(1.75), "4.0");
}

#[test]
fn a_run_is_named_in_its_record_and_in_explanations() {
    let shelf = Shelf::new();
    let graph = graph_of(&[]);
    let id = setting(&graph, &shelf, 1.5).go().unwrap().report.id;
    let second = setting(&graph, &shelf, 1.5).go().unwrap().report.id;
    assert_ne!(id, second);
    let why = setting(&graph, &shelf, 1.5).why("first").unwrap().remove(0);
    assert_eq!(
        why.computed.unwrap().run,
        id,
        "by whom it was computed, not who found it"
    );
}
