//! The invariants of the demand-and-key scheme, by their letters.

use std::path::{Path, PathBuf};

use super::kit::*;
use crate::*;

const CHOOSE: &str = "inputs: {a: Number, b: Number}
nodes:
  left: {node: Add, in: {of: a}}
  right: {node: Add, in: {of: b}}
  choose: {node: Choose, in: {a: left.sum, b: right.sum}}
outputs: {chosen: choose.chosen}";

fn choose<'g>(graph: &'g Graph, shelf: &Shelf, a: f64, b: f64) -> Run<'g> {
    Run::new(graph)
        .store(shelf.open())
        .input_value("a", Number(a))
        .input_value("b", Number(b))
}

#[test]
fn a_what_was_not_demanded_is_not_in_the_key() {
    let (graph, shelf) = (graph(CHOOSE), Shelf::new());
    let first = choose(&graph, &shelf, 1.0, 5.0).go().unwrap();
    assert_eq!(first.report.ran(), ["left", "choose"]);
    // b changes, and nobody looks at it.
    let second = choose(&graph, &shelf, 1.0, 6.0).go().unwrap();
    assert_eq!(second.report.ran(), [""; 0]);
    assert_eq!(number(&second, "chosen"), 1.0);
    // Now it is looked at, and counts.
    assert_eq!(number(&choose(&graph, &shelf, 11.0, 5.0).go().unwrap(), "chosen"), 5.0);
    assert_eq!(number(&choose(&graph, &shelf, 11.0, 6.0).go().unwrap(), "chosen"), 6.0);
}

#[test]
fn a_what_was_not_demanded_cannot_be_seen() {
    /// Looks at `b` before it asked for it.
    #[derive(Clone, Debug, Params)]
    struct Nosy {}

    impl Node for Nosy {
        const NAME: &str = "Nosy";
        const VERSION: u32 = 1;
        type Inputs = ChooseIn;
        type Outputs = AddOut;

        fn demand(&self, _: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
            known.get::<Number>("b").map(|_| Demand::ready())
        }

        fn run(&self, inputs: ChooseIn, _: &Want, _: &Context) -> Result<AddOut, NodeError> {
            Ok(AddOut { sum: inputs.a })
        }
    }

    let mut registry = registry();
    registry.node::<Nosy>();
    let text = "gear: 1\ninputs: {a: Number}\nnodes: {n: {node: Nosy, in: {a: a, b: a}}}\noutputs: {sum: n.sum}";
    let graph = GraphSource::new("test.yaml", text).check(&registry).unwrap();
    // The value is at hand: the input is given. It is kept from the node all the same.
    let outcome = Run::new(&graph).input_value("a", Number(1.0)).go().unwrap();
    assert_eq!(outcome.report.status, RunStatus::Failed);
    let chain = &outcome.report.failures[0].chain;
    assert!(chain[0].contains('b'), "{chain:?}");
}

#[test]
fn b_a_record_that_asks_for_what_cannot_be_asked_for_is_not_believed() {
    use crate::store::{Need, Record};
    let (graph, shelf) = (graph(CHOOSE), Shelf::new());
    let key = |outcome: &Outcome<'_>| outcome.report.node("choose").unwrap().outputs[0].key.clone().unwrap();
    let first = key(&choose(&graph, &shelf, 1.0, 5.0).go().unwrap());
    // Not lazy, not a port, nothing at all, and not wired.
    for ports in [&["a"][..], &["hole"], &[], &["c"]] {
        let shelf = Shelf::new();
        let store = shelf.open();
        store.publish(Record::Need(Need {
            key: Digest::from_hex(&first).unwrap(),
            ports: ports.iter().map(ToString::to_string).collect(),
            reason: String::new(),
        }));
        store.flush();
        drop(store);
        let outcome = choose(&graph, &shelf, 1.0, 5.0).go().unwrap();
        assert_eq!(
            (number(&outcome, "chosen"), key(&outcome)),
            (1.0, first.clone()),
            "{ports:?}"
        );
    }
}

#[test]
fn b_a_demand_that_is_not_new_is_the_nodes_failure() {
    #[derive(Clone, Debug, Params)]
    struct Greedy {}

    impl Node for Greedy {
        const NAME: &str = "Greedy";
        const VERSION: u32 = 1;
        type Inputs = ChooseIn;
        type Outputs = AddOut;

        fn demand(&self, _: &str, _: &Known<'_>) -> Result<Demand, NodeError> {
            Ok(Demand::need(&["b"], "again and again"))
        }

        fn run(&self, inputs: ChooseIn, _: &Want, _: &Context) -> Result<AddOut, NodeError> {
            Ok(AddOut { sum: inputs.a })
        }
    }

    let mut registry = registry();
    registry.node::<Greedy>();
    let text =
        "gear: 1\ninputs: {a: Number}\nnodes: {g: {node: Greedy, in: {a: a, b: a, c: a}}}\noutputs: {sum: g.sum}";
    let graph = GraphSource::new("test.yaml", text).check(&registry).unwrap();
    let outcome = Run::new(&graph).input_value("a", Number(1.0)).go().unwrap();
    assert_eq!(outcome.report.status, RunStatus::Failed);
    assert!(
        outcome.report.failures[0].chain[0].contains("not known yet"),
        "{:?}",
        outcome.report.failures
    );
}

#[test]
fn c_run_receives_only_what_was_demanded() {
    // `twice` demands nothing, `chosen` demands b: the node runs once for each, and `twice` is not given b.
    let body = CHOOSE.replace("chosen: choose.chosen", "chosen: choose.chosen, twice: choose.twice");
    let (graph, shelf) = (graph(&body), Shelf::new());
    let outcome = choose(&graph, &shelf, 11.0, 5.0).go().unwrap();
    assert_eq!((number(&outcome, "chosen"), number(&outcome, "twice")), (5.0, 22.0));
    let elided = &outcome.report.node("choose").unwrap().elided;
    assert_eq!(elided.len(), 1);
    assert_eq!((elided[0].output.as_str(), elided[0].port.as_str()), ("twice", "b"));
    assert_eq!(elided[0].reason, "only a is doubled");
}

#[test]
fn c_a_port_that_was_not_demanded_is_absent_although_its_value_is_at_hand() {
    /// Each output tells whether it was computed with `b`; only `chosen` demands it.
    #[derive(Clone, Debug, Params)]
    struct Spy {}

    impl Node for Spy {
        const NAME: &str = "Spy";
        const VERSION: u32 = 1;
        type Inputs = ChooseIn;
        type Outputs = ChooseOut;

        fn demand(&self, output: &str, known: &Known<'_>) -> Result<Demand, NodeError> {
            Ok(if output == "chosen" {
                known.need(&["b"], "asked")
            } else {
                Demand::ready()
            })
        }

        fn run(&self, inputs: ChooseIn, want: &Want, _: &Context) -> Result<ChooseOut, NodeError> {
            let seen = f64::from(u8::from(inputs.b.get().is_some()));
            Ok(ChooseOut {
                chosen: want.compute("chosen", || Number(seen)),
                twice: want.compute("twice", || Number(seen)),
            })
        }
    }

    let mut registry = registry();
    registry.node::<Spy>();
    let text = "gear: 1\ninputs: {a: Number}\nnodes: {spy: {node: Spy, in: {a: a, b: a}}}\n\
                outputs: {chosen: spy.chosen, twice: spy.twice}";
    let graph = GraphSource::new("test.yaml", text).check(&registry).unwrap();
    let outcome = Run::new(&graph).input_value("a", Number(1.0)).go().unwrap();
    assert_eq!((number(&outcome, "chosen"), number(&outcome, "twice")), (1.0, 0.0));
}

#[test]
fn d_an_upstream_change_that_leaves_a_value_equal_stops_there() {
    let body = "inputs: {x: Number}
nodes:
  floor: {node: Floor, in: {x: x}}
  after_whole: {node: Add, in: {of: floor.whole}}
  after_rest: {node: Add, in: {of: floor.rest}}
outputs: {whole: after_whole.sum, rest: after_rest.sum}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let run = |x: f64| {
        Run::new(&graph)
            .store(shelf.open())
            .input_value("x", Number(x))
            .go()
            .unwrap()
    };
    assert_eq!(run(3.25).report.ran(), ["floor", "after_whole", "after_rest"]);
    // The whole part is the same: per port, only what reads the rest runs.
    let second = run(3.75);
    assert_eq!(second.report.ran(), ["floor", "after_rest"]);
    assert_eq!((number(&second, "whole"), number(&second, "rest")), (3.0, 0.75));
}

#[test]
fn e_a_missing_content_is_a_miss_only_for_who_needs_the_value() {
    let body = "inputs: {x: Number}
nodes:
  floor: {node: Floor, in: {x: x}}
  measure: {node: Measure, in: {report: floor.large}}
outputs: {length: measure.length}";
    let shelf = Shelf::new();
    let run = |set: &[&str]| {
        let graph = graph_set(body, set);
        let outcome = Run::new(&graph)
            .store(shelf.open())
            .input_value("x", Number(3.5))
            .go()
            .unwrap();
        let length = number(&outcome, "length");
        (length, outcome.report)
    };
    assert_eq!(run(&[]).1.ran(), ["floor", "measure"]);
    shelf.evict_contents();
    assert_eq!(run(&[]).1.ran(), [""; 0], "digests are enough");
    let (length, report) = run(&["measure.plus=1"]);
    assert_eq!(length, 20_001.0);
    assert_eq!(
        report.ran(),
        ["floor", "measure"],
        "now the value is needed, and computed again"
    );
    assert!(report.warnings.is_empty());
}

#[test]
fn e_a_record_is_published_after_its_content() {
    // Contents cannot be written: then no record may say that they are there, however the run ends.
    let body = "inputs: {x: Number}\nnodes: {floor: {node: Floor, in: {x: x}}}\noutputs: {large: floor.large}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let store = shelf.open();
    std::fs::remove_dir_all(shelf.path().join("contents")).unwrap();
    std::fs::write(shelf.path().join("contents"), "in the way").unwrap();
    let run = Run::new(&graph).store(store).input_value("x", Number(1.0));
    let outcome = run.go().unwrap();
    let digest = outcome.digest("large").unwrap();
    drop(outcome);
    assert!(!shelf.open().has_value(&digest));
    let lost = Store::open(shelf.path()).load(&digest, &ValueType::of::<Report>());
    assert!(lost.is_none());
}

#[test]
fn f_an_output_is_the_same_whichever_others_are_wanted() {
    let (floor, x) = (Floor {}, || FloorIn {
        x: std::sync::Arc::new(Number(2.5)),
    });
    testing::assert_pure(&floor, x);
}

#[test]
#[should_panic(expected = "depends on what else is wanted")]
fn f_a_node_that_breaks_it_is_found_out() {
    #[derive(Clone, Debug, Params)]
    struct Jealous {}

    impl Node for Jealous {
        const NAME: &str = "Jealous";
        const VERSION: u32 = 1;
        type Inputs = FloorIn;
        type Outputs = FloorOut;

        fn run(&self, inputs: FloorIn, want: &Want, _: &Context) -> Result<FloorOut, NodeError> {
            let other = if want.has("rest") { 1.0 } else { 0.0 };
            Ok(FloorOut {
                whole: want.compute("whole", || Number(inputs.x.0 + other)),
                rest: want.compute("rest", || Number(0.0)),
                large: want.try_compute("large", || Report::new(0))?,
            })
        }
    }

    testing::assert_pure(&Jealous {}, || FloorIn {
        x: std::sync::Arc::new(Number(2.5)),
    });
}

#[test]
fn g_a_run_without_elision_has_keys_of_its_own_and_the_same_result() {
    let (graph, shelf) = (graph(CHOOSE), Shelf::new());
    let with = choose(&graph, &shelf, 1.0, 5.0).go().unwrap();
    let without = choose(&graph, &shelf, 1.0, 5.0).no_elision().go().unwrap();
    assert_eq!(
        without.report.ran(),
        ["right", "choose"],
        "nothing is taken from the run with elision"
    );
    let key = |outcome: &Outcome<'_>| outcome.report.node("choose").unwrap().outputs[0].key.clone();
    assert_ne!(key(&with), key(&without));
    // This node is made so that it notices; `with == without` is what the tests of real elisions say.
    assert_eq!((number(&with, "chosen"), number(&without, "chosen")), (1.0, 5.0));
}

#[test]
fn h_a_file_is_a_load_action_keyed_by_its_bytes_and_the_loaders_parameters() {
    let shelf = Shelf::new();
    let body = "inputs: {x: Number}\nnodes: {add: {node: Add, in: {of: x}}}\noutputs: {sum: add.sum}";
    let run = |name: &str, text: &str, set: &[&str]| {
        let path = shelf.path().join(name);
        std::fs::write(&path, text).unwrap();
        let graph = graph_set(body, set);
        let outcome = Run::new(&graph)
            .store(shelf.open())
            .input("x", Input::file(path))
            .go()
            .unwrap();
        let ran: Vec<_> = outcome.report.ran().into_iter().map(String::from).collect();
        (number(&outcome, "sum"), ran)
    };
    assert_eq!(run("one.txt", "4", &[]), (4.0, vec!["x".into(), "add".into()]));
    assert_eq!(
        run("other-name.txt", "4", &[]),
        (4.0, vec![]),
        "the path is not in the key"
    );
    assert_eq!(run("one.txt", "5", &[]).0, 5.0, "the bytes are");
    assert_eq!(
        run("one.txt", "4", &["x.scale=2"]),
        (8.0, vec!["x".into(), "add".into()]),
        "so are parameters"
    );
    // Other bytes that load to the same value: loaded, and cut off there.
    assert_eq!(run("one.txt", "4.0\n", &[]), (4.0, vec!["x".into()]));
}

#[test]
fn h_a_loader_of_another_version_loads_again() {
    /// Reads the same, says that it is newer.
    #[derive(Clone, Debug, Params)]
    struct Newer {}

    impl Loader for Newer {
        const VERSION: u32 = 2;
        type Value = Number;

        fn load(&self, file: &FileSource, ctx: &Context) -> Result<Number, NodeError> {
            NumberText { scale: 1.0 }.load(file, ctx)
        }
    }

    let shelf = Shelf::new();
    let path = shelf.path().join("one.txt");
    std::fs::write(&path, "4").unwrap();
    let (mut old, mut new) = (Registry::new(), Registry::new());
    old.node::<Add>().loader::<NumberText>();
    new.node::<Add>().loader::<Newer>();
    let ran = |registry: &Registry| {
        let text = "gear: 1\ninputs: {x: Number}\nnodes: {add: {node: Add, in: {of: x}}}\noutputs: {sum: add.sum}";
        let graph = GraphSource::new("test.yaml", text).check(registry).unwrap();
        let run = Run::new(&graph).store(shelf.open()).input("x", Input::file(&path));
        let report = run.go().unwrap().report;
        report.ran().into_iter().map(String::from).collect::<Vec<_>>()
    };
    assert_eq!(ran(&old), ["x", "add"]);
    assert_eq!(ran(&new), ["x"], "the value is the same: cut off there");
    assert_eq!(ran(&new), [""; 0]);
}

#[test]
fn h_files_beside_a_file_belong_to_what_identifies_it() {
    /// Reads a number, times the one in `NAME.scale` if that is there.
    #[derive(Clone, Debug, Params)]
    struct Scaled {}

    impl Loader for Scaled {
        const VERSION: u32 = 1;
        type Value = Number;

        fn beside(&self, path: &Path) -> Vec<PathBuf> {
            vec![path.with_extension("scale")]
        }

        fn load(&self, file: &FileSource, ctx: &Context) -> Result<Number, NodeError> {
            let beside = file.as_path().map(|path| path.with_extension("scale"));
            let scale = beside.and_then(|path| std::fs::read_to_string(path).ok());
            let scale = scale.map_or(1.0, |text| text.parse().unwrap());
            NumberText { scale }.load(file, ctx)
        }
    }

    let shelf = Shelf::new();
    let mut registry = Registry::new();
    registry.node::<Add>().loader::<Scaled>();
    let run = |name: &str, number_in_it: &str, scale: Option<&str>| {
        let path = shelf.path().join(name);
        std::fs::write(&path, number_in_it).unwrap();
        let beside = path.with_extension("scale");
        match scale {
            Some(scale) => std::fs::write(&beside, scale).unwrap(),
            None => drop(std::fs::remove_file(&beside)),
        }
        let text = "gear: 1\ninputs: {x: Number}\nnodes: {add: {node: Add, in: {of: x}}}\noutputs: {sum: add.sum}";
        let graph = GraphSource::new("test.yaml", text).check(&registry).unwrap();
        let outcome = Run::new(&graph)
            .store(shelf.open())
            .input("x", Input::file(path))
            .go()
            .unwrap();
        (number(&outcome, "sum"), outcome.report.ran().len())
    };
    assert_eq!(run("one.txt", "4", None), (4.0, 2));
    assert_eq!(run("one.txt", "4", Some("3")), (12.0, 2));
    assert_eq!(
        run("elsewhere.txt", "4", Some("3")),
        (12.0, 0),
        "the paths are not in the key"
    );
    assert_eq!(run("one.txt", "4", Some("2")).0, 8.0);
    assert_eq!(
        run("one.txt", "4", None),
        (4.0, 0),
        "without it, the key is that of the file alone"
    );
}

#[test]
fn a_warm_run_loads_no_value() {
    let body = "inputs: {x: Number}
nodes:
  floor: {node: Floor, in: {x: x}}
  measure: {node: Measure, in: {report: floor.large}}
outputs: {length: measure.length, large: floor.large}";
    let (graph, shelf) = (graph(body), Shelf::new());
    let run = || {
        Run::new(&graph)
            .store(shelf.open())
            .input_value("x", Number(1.0))
            .go()
            .unwrap()
    };
    run();
    // Whatever is read now would be found damaged.
    for folder in std::fs::read_dir(shelf.path().join("contents")).unwrap() {
        for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
            std::fs::write(file.unwrap().path(), b"damaged").unwrap();
        }
    }
    let warm = run();
    assert_eq!(warm.report.with_status(NodeStatus::Cached), ["floor", "measure"]);
    assert!(warm.report.warnings.is_empty(), "{:?}", warm.report.warnings);
    // Asking for the value finds the damage, warns and computes again.
    assert!(warm.value("large").is_some());
    assert_eq!(number(&warm, "length"), 20_000.0);
}

#[test]
fn keys_are_what_they_always_were() {
    // Raise `keys::FORMAT` when this must change: what users have stored is then a clean miss.
    let graph = graph(CHOOSE);
    let outcome = Run::new(&graph)
        .input_value("a", Number(1.0))
        .input_value("b", Number(2.0))
        .go()
        .unwrap();
    let keys: Vec<_> = outcome
        .report
        .nodes
        .iter()
        .flat_map(|node| {
            node.outputs
                .iter()
                .map(move |port| format!("{}.{} {:?}", node.id, port.port, port.key))
        })
        .collect();
    insta::assert_debug_snapshot!("golden_keys", keys);
}
