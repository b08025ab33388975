//! A graph from the store is the graph that checking the file gives.

use proptest::prelude::*;

use super::*;
use crate::Library;
use crate::graph::GraphSource;
use crate::run::tests::kit::registry;

const TEXT: &str = "gear: 1
inputs: {x: {type: Number, with: {scale: 2}}, y: {type: Number, optional: true}}
nodes:
  last: {node: Add, in: {of: [choose.chosen, early.sum, x]}, with: {plus: 0.5}}
  choose: {node: Choose, in: {a: early.sum, b: x, c: y}, with: {when: {above: {threshold: 3}}}}
  early: {node: Add, in: {of: x}}
  other: {node: Ranged, in: {x: early.sum}, with: {list: [1, 2.5], flag: true, auto: auto}}
outputs: {sum: last.sum, rest: other.rest}
snapshots: {early: early.sum, last: {port: last.sum, norm: max, tolerance: 0.25, size: 7}}
";

/// All that a run can see of a graph.
fn seen(graph: &Graph) -> String {
    let nodes: Vec<_> = graph
        .nodes()
        .iter()
        .enumerate()
        .map(|(i, node)| {
            format!(
                "{} {} {:?} {:?}",
                node.id,
                node.spec.name,
                node.params(),
                graph.wiring(i)
            )
        })
        .collect();
    let inputs: Vec<_> = graph
        .inputs()
        .iter()
        .map(|input| {
            format!(
                "{} {:?} {} {:?}",
                input.name,
                input.value_type,
                input.optional,
                input.params()
            )
        })
        .collect();
    let outputs: Vec<_> = graph
        .outputs()
        .iter()
        .map(|output| format!("{} {}", output.name, graph.output_source(output)))
        .collect();
    format!(
        "{} {nodes:#?} {inputs:#?} {outputs:#?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
        graph.name,
        graph.snapshots,
        graph.first_slot,
        graph.site_of,
        graph.wires,
        graph.first_wire,
        graph.readers,
        graph.first_reader,
        graph.order,
        graph.files,
        graph.warnings,
    )
}

fn store() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path());
    (folder, store)
}

#[test]
fn a_graph_from_the_store_is_the_graph_that_was_checked() {
    let (_folder, store) = store();
    let (registry, source) = (registry(), GraphSource::new("a.yaml", TEXT).set("early.plus=7"));
    let checked = source.check(&registry).unwrap();
    assert!(find(&source, &registry, &store).is_none());
    assert_eq!(seen(&source.check_in(&registry, &store).unwrap()), seen(&checked));
    let found = find(&source, &registry, &store).expect("it was kept");
    assert_eq!(seen(&found), seen(&checked));
}

#[test]
fn other_bytes_another_override_or_another_registry_are_not_it() {
    let (_folder, store) = store();
    let (known, source) = (registry(), GraphSource::new("a.yaml", TEXT));
    source.check_in(&known, &store).unwrap();
    assert!(find(&source, &known, &store).is_some());
    assert!(find(&source.clone().set("early.plus=7"), &known, &store).is_none());
    assert!(find(&GraphSource::new("a.yaml", TEXT.replace("0.5", "0.6")), &known, &store).is_none());
    let mut other = Registry::new();
    other.node::<crate::run::tests::kit::Add>();
    assert!(find(&source, &other, &store).is_none());
}

#[test]
fn a_file_that_it_extends_is_looked_at_again() {
    let (folder, store) = store();
    let (base, top) = (folder.path().join("base.yaml"), folder.path().join("top.yaml"));
    std::fs::write(&base, TEXT).unwrap();
    std::fs::write(&top, "gear: 1\nextends: base.yaml\nnodes: {last: {with: {plus: 2}}}\n").unwrap();
    let (registry, name) = (registry(), top.to_string_lossy().into_owned());
    let source = GraphSource::open(name, &Library::default()).unwrap();
    let checked = source.check_in(&registry, &store).unwrap();
    assert_eq!(seen(&find(&source, &registry, &store).unwrap()), seen(&checked));
    std::fs::write(&base, TEXT.replace("threshold: 3", "threshold: 4")).unwrap();
    assert!(find(&source, &registry, &store).is_none());
    let changed = source.check_in(&registry, &store).unwrap();
    assert!(seen(&changed).contains("4.0"));
    assert_eq!(seen(&find(&source, &registry, &store).unwrap()), seen(&changed));
}

#[test]
fn a_graph_with_a_warning_is_read_again_to_show_where() {
    let (_folder, store) = store();
    let text = TEXT.replace("outputs:", "  idle: {node: Add, in: {of: x}}\noutputs:");
    let (registry, source) = (registry(), GraphSource::new("a.yaml", text));
    for _ in 0..2 {
        let graph = source.check_in(&registry, &store).unwrap();
        assert!(graph.warnings().render(false).contains("idle"));
    }
}

fn bytes() -> Vec<u8> {
    let (_folder, store) = store();
    let (registry, source) = (registry(), GraphSource::new("a.yaml", TEXT));
    source.check_in(&registry, &store).unwrap();
    store.get_blob(&key(&source, &registry)).unwrap()
}

proptest! {
    #[test]
    fn odd_bytes_are_no_graph_or_one_that_holds_together(
        at in 0usize..10_000,
        with in any::<[u8; 3]>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = bytes();
        let at = at % bytes.len();
        if cut {
            bytes.truncate(at);
        }
        for (place, byte) in bytes.iter_mut().skip(at).zip(with) {
            *place = byte;
        }
        if let Some(graph) = format::read(&bytes, &registry()) {
            // Whatever it is, everything in it can be looked up.
            prop_assert!(!seen(&graph).is_empty());
        }
    }
}
