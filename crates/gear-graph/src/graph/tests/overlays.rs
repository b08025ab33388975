//! Graphs over graphs: what is replaced, what is removed, and where mistakes point.

use serde_json::json;

use super::*;
use crate::graph::{Library, Norm, snapshots};
use crate::run::tests::kit::Shelf;

const BASE: &str = "gear: 1
inputs:
  x: {type: Number, with: {scale: 3}}
  y: {type: Number, optional: true}
nodes:
  first:  {node: Add, in: {of: [x, y]}, with: {plus: 1}}
  choose: {node: Choose, in: {a: first.sum, b: x, c: x}, with: {when: {above: {threshold: 2}}}}
  ranged: {node: Ranged, in: {x: choose.chosen}, with: {share: 0.25, count: 2, list: [1, 2]}}
outputs:
  chosen: choose.chosen
  whole: ranged.whole
";

/// Files that are found as `@base`, `@middle`, …
fn library(files: &[(&'static str, &'static str)]) -> Library {
    Library::holding(files.iter().copied())
}

fn check(library: &Library) -> Result<Graph, Mistakes> {
    GraphSource::open("@top", library).unwrap().check(&registry())
}

fn over(text: &'static str) -> Result<Graph, Mistakes> {
    check(&library(&[("base", BASE), ("top", text)]))
}

fn params(graph: &Graph, id: &str) -> serde_json::Value {
    let node = graph.nodes().iter().find(|node| node.id == id).unwrap();
    serde_json::Value::Object(node.params())
}

fn ids(graph: &Graph) -> Vec<&str> {
    graph.nodes().iter().map(|node| node.id.as_str()).collect()
}

fn wiring(graph: &Graph, id: &str) -> Vec<String> {
    let at = graph.nodes().iter().position(|node| node.id == id).unwrap();
    let wiring = graph.wiring(at);
    wiring.iter().map(|(port, from)| format!("{port}: {from}")).collect()
}

#[test]
fn an_overlay_that_says_nothing_is_its_base() {
    let graph = over("{gear: 1, extends: '@base', nodes: , inputs: {x: {with: }}, outputs: {}}").unwrap();
    assert_eq!(ids(&graph), ["first", "choose", "ranged"]);
    assert_eq!(wiring(&graph, "choose"), ["a: first.sum", "b: x", "c: x"]);
    assert_eq!(params(&graph, "first"), json!({"plus": 1.0}));
    assert_eq!(graph.inputs()[0].params()["scale"], json!(3.0));
    assert!(graph.inputs()[1].optional);
}

#[test]
fn snapshots_are_replaced_key_by_key_and_change_no_key_of_a_result() {
    let pinned = "gear: 1
extends: '@base'
snapshots: {a: first.sum, b: {port: ranged.whole, norm: max, tolerance: 0.5}, c: x}
";
    let top = "gear: 1
extends: '@middle'
snapshots: {a: {tolerance: 2, size: 9}, b: choose.chosen, c: null}
";
    let graph = check(&library(&[("base", BASE), ("middle", pinned), ("top", top)])).unwrap();
    let told: Vec<_> = graph
        .snapshots()
        .iter()
        .map(|s| (s.name.as_str(), graph.snapshot_source(s), s.norm, s.tolerance, s.size))
        .collect();
    let norm = snapshots::NORM;
    assert_eq!(
        told,
        [
            ("a", "first.sum".to_owned(), norm, 2.0, 9),
            ("b", "choose.chosen".to_owned(), Norm::Max, 0.5, snapshots::SIZE),
        ]
    );
    let keys = |graph: &Graph| {
        let run = Run::new(graph)
            .input_value("x", Number(1.0))
            .input_value("y", Number(2.0));
        let report = run.go().unwrap().report;
        let ports = report
            .nodes
            .iter()
            .filter(|node| node.id == "first")
            .flat_map(|node| node.outputs.clone());
        ports.map(|port| (port.port, port.key)).collect::<Vec<_>>()
    };
    let plain = check(&library(&[("top", BASE)])).unwrap();
    assert_eq!(keys(&graph), keys(&plain));
    let pinned = graph.into_snapshots();
    let outputs: Vec<_> = pinned.outputs().iter().map(|output| output.name.as_str()).collect();
    assert_eq!(outputs, ["a", "b"]);
    assert_eq!(keys(&pinned), keys(&plain));
}

#[test]
fn parameters_and_wires_are_replaced_one_by_one() {
    let graph = over(
        "gear: 1
extends: '@base'
inputs: {x: {with: {scale: 5}}}
nodes:
  choose: {in: {b: first.sum}}
  ranged: {with: {count: 7, list: [3]}}
",
    )
    .unwrap();
    assert_eq!(graph.inputs()[0].params()["scale"], json!(5.0));
    assert_eq!(wiring(&graph, "choose"), ["a: first.sum", "b: first.sum", "c: x"]);
    let ranged = params(&graph, "ranged");
    assert_eq!(
        (&ranged["share"], &ranged["count"], &ranged["list"]),
        (&json!(0.25), &json!(7), &json!([3.0]))
    );
}

#[test]
fn null_removes_nodes_inputs_outputs_wires_and_parameters() {
    let graph = over(
        "gear: 1
extends: '@base'
inputs: {y: null}
nodes:
  first: {in: {of: x}, with: {plus: null}}
  choose: {in: {c: ~}}
  ranged:
outputs: {whole: null, twice: choose.twice}
",
    )
    .unwrap();
    assert_eq!(graph.inputs().len(), 1);
    assert_eq!(ids(&graph), ["first", "choose"]);
    assert_eq!(wiring(&graph, "choose"), ["a: first.sum", "b: x"]);
    assert_eq!(params(&graph, "first"), json!({"plus": 0.0}), "the default again");
    let outputs: Vec<_> = graph.outputs().iter().map(|output| output.name.as_str()).collect();
    assert_eq!(outputs, ["chosen", "twice"]);
}

#[test]
fn null_for_a_parameter_that_no_base_sets_is_its_default() {
    let graph = over(
        "gear: 1
extends: '@base'
inputs: {y: {with: {scale: null}}}
nodes:
  ranged: {with: {auto: null, flag: null}}
  choose: {with: {when: {never: {}}}}
  new: {node: Ranged, in: {x: x}, with: {share: null, low: 0.5}}
  other: {node: Choose, in: {a: x, b: x}, with: {when: {above: {threshold: null}}}}
outputs: {new: new.whole, other: other.chosen}
",
    )
    .unwrap();
    assert_eq!(params(&graph, "ranged")["share"], json!(0.25), "the others stay");
    assert_eq!(params(&graph, "ranged")["auto"], json!("auto"));
    let new = params(&graph, "new");
    assert_eq!((&new["share"], &new["low"]), (&json!(0.5), &json!(0.5)));
    assert_eq!(params(&graph, "other")["when"], json!({"above": {"threshold": 10.0}}));
    assert_eq!(graph.inputs()[1].params()["scale"], json!(1.0));
    // In a graph that extends nothing, there is nothing to remove.
    let alone =
        "gear: 1\ninputs: {x: Number}\nnodes: {a: {node: Add, in: {of: x}, with: {plus: null}}}\noutputs: {y: a.sum}\n";
    assert_eq!(super::mistakes(alone).problems()[0].code, "wrong-parameter-type");
}

#[test]
fn null_for_a_parameter_that_nothing_has_is_a_mistake() {
    let text = "gear: 1
extends: '@base'
inputs: {y: {with: {scal: null}}}
nodes:
  ranged: {with: {shar: null}}
  new: {node: Add, in: {of: x}, with: {pluss: null}}
  choose: {with: {when: {above: {treshold: null}}}}
  other: {node: Choose, in: {a: x, b: x}, with: {when: {above: {thresold: null}}}}
outputs: {new: new.sum, other: other.chosen}
";
    insta::assert_snapshot!(over(text).unwrap_err());
}

#[test]
fn the_same_method_is_merged_and_another_one_replaces_it() {
    let when = |text| params(&over(text).unwrap(), "choose")["when"].clone();
    assert_eq!(
        when("{gear: 1, extends: '@base', nodes: {choose: {with: {when: always}}}}"),
        json!("always")
    );
    assert_eq!(
        when("{gear: 1, extends: '@base', nodes: {choose: {with: {when: {never: {}}}}}}"),
        json!("never")
    );
    for (text, threshold) in [
        ("{above: {threshold: 4}}", 4.0),
        ("{above: {}}", 2.0),
        ("{above: {threshold: null}}", 10.0),
        ("above", 10.0),
        ("null", 10.0),
    ] {
        let text = format!("{{gear: 1, extends: '@base', nodes: {{choose: {{with: {{when: {text}}}}}}}}}");
        assert_eq!(when(text.leak()), json!({"above": {"threshold": threshold}}));
    }
}

#[test]
fn another_type_of_node_keeps_the_wires_and_not_the_parameters() {
    let graph = over("{gear: 1, extends: '@base', nodes: {ranged: {node: Floor}}}").unwrap();
    assert_eq!(wiring(&graph, "ranged"), ["x: choose.chosen"]);
    assert_eq!(params(&graph, "ranged"), json!({}));
    let graph = over("{gear: 1, extends: '@base', nodes: {ranged: {node: Ranged}}}").unwrap();
    assert_eq!(params(&graph, "ranged")["count"], json!(2), "the same type keeps them");
}

#[test]
fn what_is_new_is_added_and_what_is_replaced_keeps_its_place() {
    let graph = over(
        "gear: 1
extends: '@base'
nodes:
  last: {node: Floor, in: {x: first.sum}}
  first: {with: {plus: 2}}
outputs: {last: last.whole}
",
    )
    .unwrap();
    assert_eq!(ids(&graph), ["first", "choose", "ranged", "last"]);
}

#[test]
fn overlays_extend_overlays_and_the_files_are_told() {
    let middle =
        "{gear: 1, extends: base.yaml, nodes: {first: {with: {plus: 5}}, ranged: null}, outputs: {whole: null}}";
    let top = "{gear: 1, extends: '@folder/middle', nodes: {choose: {with: {when: never}}, ranged: {node: Floor, in: {x: x}}}, outputs: {w: ranged.whole}}";
    let library = library(&[("folder/base", BASE), ("folder/middle", middle), ("top", top)]);
    let graph = check(&library).unwrap();
    assert_eq!(params(&graph, "first"), json!({"plus": 5.0}));
    assert_eq!(params(&graph, "choose"), json!({"when": "never"}));
    assert_eq!(
        wiring(&graph, "ranged"),
        ["x: x"],
        "nothing of a node that was removed comes back"
    );
    let names: Vec<_> = graph.files().iter().map(|file| file.name.as_str()).collect();
    assert_eq!(names, ["@top", "@folder/middle", "@folder/base"]);
    for file in graph.files() {
        let text = library.read(&file.name).unwrap();
        assert_eq!(file.digest, Digest::of(text.as_bytes()), "{}", file.name);
    }
}

#[test]
fn paths_are_found_from_the_file_that_names_them() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("below")).unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(path("base.yaml"), BASE).unwrap();
    std::fs::write(path("below/middle.yaml"), "{gear: 1, extends: ../base.yaml}").unwrap();
    std::fs::write(path("top.yaml"), "{gear: 1, extends: below/middle.yaml}").unwrap();
    let graph = GraphSource::open(path("top.yaml"), &Library::default())
        .unwrap()
        .check(&registry())
        .unwrap();
    let names: Vec<_> = graph.files().iter().map(|file| file.name.clone()).collect();
    assert_eq!(names, [path("top.yaml"), path("below/middle.yaml"), path("base.yaml")]);
}

#[test]
fn a_ring_of_files_is_found_under_any_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    std::fs::create_dir(folder.path().join("below")).unwrap();
    std::fs::write(path("a.yaml"), "{gear: 1, extends: below/../b.yaml}").unwrap();
    std::fs::write(path("b.yaml"), "{gear: 1, extends: ./below/.././a.yaml}").unwrap();
    let source = GraphSource::open(path("a.yaml"), &Library::default()).unwrap();
    let mistakes = source.check(&registry()).unwrap_err();
    assert_eq!(mistakes.problems()[0].code, "extends-cycle");
}

#[test]
fn long_chains_do_not_exhaust_anything() {
    let mut files = vec![
        ("base".to_owned(), BASE.to_owned()),
        ("link0".to_owned(), "{gear: 1, extends: '@base'}".to_owned()),
    ];
    for i in 1..3000 {
        let text = format!(
            "{{gear: 1, extends: '@link{}', nodes: {{first: {{with: {{plus: {i}}}}}}}}}",
            i - 1
        );
        files.push((format!("link{i}"), text));
    }
    let library = Library::holding(files);
    let graph = GraphSource::open("@link2999", &library)
        .unwrap()
        .check(&registry())
        .unwrap();
    assert_eq!(params(&graph, "first"), json!({"plus": 2999.0}));
}

/// Files that are wrong together; the first one is checked.
pub const MISTAKES: &[&[(&str, &str)]] = &[
    // A parameter, a wire and a port of the overlay are wrong, and so is a line of its base.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
nodes:
  first: {with: {plus: lots, minus: 1}, in: {off: x}}
  ranged: {with: {share: 2}}
outputs: {chosen: choose.chosn}
",
        ),
        (
            "base.yaml",
            "gear: 1
inputs: {x: Number}
nodes:
  first:  {node: Add, in: {of: x}}
  choose: {node: Choose, in: {a: first.sum, b: x}}
  ranged: {node: Ranged, in: {x: choose.chosen}, with: {count: none, list: [1, 2]}}
outputs: {chosen: choose.chosen, whole: ranged.whole}
",
        ),
    ],
    // What is removed is read, in the base and in the overlay.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
nodes:
  first: null
outputs: {sum: first.sum}
",
        ),
        ("base.yaml", BASE),
    ],
    // Nothing stands where something is to be removed.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
inputs: {z: null}
nodes:
  frist: null
  first: {with: {minus: null}, in: {off: null}}
  choose: {in: {d: null}}
outputs: {hole: null}
",
        ),
        ("base.yaml", BASE),
    ],
    // Another type has other ports.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
nodes:
  first: {node: Measure}
  choose: {node: Floor}
",
        ),
        ("base.yaml", BASE),
    ],
    // A value of another type comes out of a port of the same name.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
inputs: {x: Report}
",
        ),
        ("base.yaml", BASE),
    ],
    // A loop through both files.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
nodes:
  first: {in: {of: [x, ranged.whole]}}
",
        ),
        ("base.yaml", BASE),
    ],
    // What the overlay leaves unused.
    &[
        (
            "over.yaml",
            "gear: 1
extends: base.yaml
nodes:
  spare: {node: Floor, in: {x: x}}
outputs: {whole: null}
",
        ),
        ("base.yaml", BASE),
    ],
    // No such file; a ring of files; a file that is no YAML; one of a version to come; one that is no graph.
    &[("over.yaml", "{gear: 1, extends: bsae.yaml}"), ("base.yaml", BASE)],
    &[("over.yaml", "{gear: 1, extends: '@baze'}"), ("base.yaml", BASE)],
    &[
        ("over.yaml", "gear: 1\nextends: middle.yaml\n"),
        ("middle.yaml", "extends: base.yaml\ngear: 1\n"),
        ("base.yaml", "gear: 1\n\nextends: ./middle.yaml\n"),
    ],
    &[
        ("over.yaml", "{gear: 1, extends: base.yaml}"),
        ("base.yaml", "{gear: 1"),
    ],
    &[
        ("over.yaml", "{gear: 1, extends: base.yaml}"),
        ("base.yaml", "{gear: 2}"),
    ],
    &[("over.yaml", "{extends: base.yaml, nodes: []}"), ("base.yaml", "[]")],
    &[("over.yaml", "{gear: 1, extends: [base.yaml]}")],
];

/// What is wrong with these files. They are held by the library, so that the messages hold no folder.
pub fn mistakes(files: &[(&'static str, &'static str)]) -> Mistakes {
    let name = |file: &'static str| file.trim_end_matches(".yaml");
    let library = Library::holding(files.iter().map(|(file, text)| (name(file), *text)));
    let source = GraphSource::open(format!("@{}", name(files[0].0)), &library).unwrap();
    mistakes_of(&source)
}

#[test]
fn mistakes_point_into_the_file_where_they_stand() {
    let said: Vec<_> = MISTAKES.iter().map(|files| mistakes(files).to_string()).collect();
    insta::assert_snapshot!(said.join("\n--------\n\n"));
}

#[test]
fn mistakes_for_editors_name_their_file() {
    let json = mistakes(MISTAKES[0]).to_json();
    let files: Vec<_> = json
        .as_array()
        .unwrap()
        .iter()
        .map(|mistake| &mistake["file"])
        .collect();
    assert!(
        files.contains(&&json!("@over")) && files.contains(&&json!("@base")),
        "{files:?}"
    );
}

#[test]
fn what_is_resolved_is_the_same_graph_with_the_same_keys() {
    let overlay = "gear: 1
extends: '@base'
inputs: {y: null}
nodes:
  first: {in: {of: x}, with: {plus: 5}}
  choose: {with: {when: {above: {threshold: 3}}}}
  ranged: {with: {list: null}}
  more: {node: Floor, in: {x: choose.twice}}
outputs: {whole: null, more: more.rest}
";
    let mut source = GraphSource::open("@top", &library(&[("base", BASE), ("top", overlay)])).unwrap();
    source.set = vec!["ranged.share=0.5".into()];
    let text = source.resolve(&registry()).unwrap();
    insta::assert_snapshot!("resolved", text);

    let run = |graph: &Graph, store: &Arc<Store>| {
        let outcome = Run::new(graph)
            .input("x", Input::Value(AnyValue::new(Number(7.25))))
            .store(Arc::clone(store))
            .go()
            .unwrap();
        let mut keys: Vec<String> = outcome
            .report
            .nodes
            .iter()
            .flat_map(|node| {
                node.outputs
                    .iter()
                    .map(|port| format!("{} {} {:?}", node.id, port.port, port.key))
            })
            .collect();
        keys.sort();
        (keys, outcome.report.ran().len())
    };
    let shelf = Shelf::new();
    let store = shelf.open();
    let overlaid = source.check(&registry()).unwrap();
    let resolved = GraphSource::new("resolved.yaml", text).check(&registry()).unwrap();
    assert!(resolved.warnings().problems().len() == overlaid.warnings().problems().len());
    let (cold, ran) = run(&overlaid, &store);
    assert!(ran > 0 && !cold.is_empty());
    assert_eq!(run(&resolved, &store), (cold, 0));
}
