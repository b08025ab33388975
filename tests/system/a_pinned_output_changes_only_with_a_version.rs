//! A result cannot change unless a version is raised.
//!
//! A key holds everything that a value depends on: the node's version, the numerics of its crates, its parameters and
//! the digests of its inputs. `pins.lock` holds the key and the digest of every output of the shipped graphs on a
//! small sample. Where the key is the same and the digest is another, users would get old results from their stores
//! and new ones from an empty store: somebody changed what a node computes and raised nothing.
//!
//! `GEAR_PINS=update cargo test -p gear-tests pinned` writes the file anew, and refuses to when that is so.
//!
//! What this cannot see: a node that changed in the same commit in which its inputs did. Its key is another then.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use gear_graph::GraphSource;
use gear_tests::{Desk, json};

use crate::MAIN;

/// One output of a run.
#[derive(Clone, Debug, PartialEq)]
struct Pin {
    /// `@gear refine.scene`.
    place: String,
    /// `Refine 3 (gear-image 2, gear-splat 1)`.
    behaviour: String,
    key: String,
    digest: String,
}

const HEAD: &str = "\
# Outputs of the shipped graphs on a small sample: place | node type, version and numerics | key | digest.
# A digest may change only together with its key. `GEAR_PINS=update cargo test -p gear-tests pinned` writes this file.
";

fn write(pins: &[Pin]) -> String {
    let mut text = HEAD.to_owned();
    for pin in pins {
        let _ = writeln!(text, "{} | {} | {} | {}", pin.place, pin.behaviour, pin.key, pin.digest);
    }
    text
}

fn read(text: &str) -> Vec<Pin> {
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| {
            let parts: Vec<_> = line.split(" | ").map(str::to_owned).collect();
            let [place, behaviour, key, digest] = parts.try_into().ok()?;
            Some(Pin {
                place,
                behaviour,
                key,
                digest,
            })
        })
        .collect()
}

/// Values that changed under an unchanged key, and pins that are not of this code any more.
fn compare(pinned: &[Pin], found: &[Pin]) -> (Vec<String>, Vec<String>) {
    let mut changed = Vec::new();
    for pin in found {
        // Graphs share nodes: a key may be pinned at several places.
        let other = |before: &&Pin| before.key == pin.key && before.digest != pin.digest;
        if let Some(before) = pinned.iter().find(other) {
            changed.push(format!(
                "{}: the value is another than it was, and {} is the version still.\n  Raise VERSION of the node type, or \
                 NUMERICS of the crate that computes otherwise.\n  digest {} -> {}",
                pin.place, pin.behaviour, before.digest, pin.digest
            ));
        }
    }
    let places =
        |pins: &[Pin]| -> BTreeMap<String, Pin> { pins.iter().map(|p| (p.place.clone(), p.clone())).collect() };
    let (old, new) = (places(pinned), places(found));
    let stale = new
        .iter()
        .filter(|(place, pin)| old.get(*place) != Some(pin))
        .map(|(place, pin)| match old.get(place) {
            Some(old) if old.behaviour != pin.behaviour => format!("{place}: {} -> {}", old.behaviour, pin.behaviour),
            Some(_) => format!("{place}: its inputs or parameters are others"),
            None => format!("{place}: new"),
        })
        .chain(
            old.keys()
                .filter(|place| !new.contains_key(*place))
                .map(|place| format!("{place}: gone")),
        )
        .collect();
    (changed, stale)
}

/// All outputs of a record.
fn pins_of(graph: &str, record: &serde_json::Value) -> Vec<Pin> {
    let mut pins = Vec::new();
    for node in record["nodes"].as_array().unwrap() {
        let numerics: Vec<_> = node["numerics"]
            .as_array()
            .unwrap()
            .iter()
            .map(|n| format!("{} {}", n["name"].as_str().unwrap(), n["version"]))
            .collect();
        let behaviour = format!(
            "{} {} ({})",
            node["type"].as_str().unwrap(),
            node["node_version"],
            numerics.join(", ")
        );
        for port in node["outputs"].as_array().unwrap() {
            let (Some(key), Some(digest)) = (port["key"].as_str(), port["digest"].as_str()) else {
                continue;
            };
            pins.push(Pin {
                place: format!(
                    "{graph} {}.{}",
                    node["id"].as_str().unwrap(),
                    port["port"].as_str().unwrap()
                ),
                behaviour: behaviour.clone(),
                key: key[..32].to_owned(),
                digest: digest[..32].to_owned(),
            });
        }
    }
    pins
}

#[test]
fn pinned_outputs_are_what_they_were() {
    let desk = Desk::new();
    let mut found = Vec::new();
    desk.gear(&[MAIN, &["--quiet"]].concat()).exits(0);
    found.extend(pins_of("@gear", &json(&desk.path("out/run.json"))));
    for name in ["raw", "histogram-equalization", "retinex"] {
        let graph = format!("@baselines/{name}");
        let set = |node: &'static str| ["--set", node];
        let arguments = [
            &["run", &graph, "--input", "painting=sample:vessel", "--quiet"][..],
            &set("painting.size=64"),
            &set("orbit.orbit=4"),
            &set("orbit.size=48"),
        ];
        desk.gear(&arguments.concat()).exits(0);
        found.extend(pins_of(&graph, &json(&desk.path("out/run.json"))));
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("pins.lock");
    let pinned = read(&std::fs::read_to_string(&path).unwrap_or_default());
    let (changed, stale) = compare(&pinned, &found);
    assert!(changed.is_empty(), "{}", changed.join("\n"));
    if std::env::var("GEAR_PINS").is_ok_and(|what| what == "update") {
        std::fs::write(&path, write(&found)).unwrap();
        return;
    }
    assert!(
        stale.is_empty(),
        "versions were raised, or graphs changed; look at what is new and run \
         `GEAR_PINS=update cargo test -p gear-tests pinned`, which writes tests/pins.lock:\n{}",
        stale.join("\n")
    );
}

/// A node that a shipped graph uses cannot change unseen because its branch was left out on this sample. Nodes of plugins
/// and answers of services are not gear's to pin.
#[test]
fn every_node_type_of_the_shipped_graphs_is_pinned() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("pins.lock");
    let pinned = read(&std::fs::read_to_string(path).unwrap());
    let registry = gear_cli::with_shipped(gear_cli::registry());
    let mut missing = Vec::new();
    for shipped in gear_cli::shipped()
        .iter()
        .filter(|graph| !graph.name.starts_with("services/"))
    {
        let graph = GraphSource::open(format!("@{}", shipped.name), &gear_cli::library())
            .unwrap()
            .check(&registry)
            .unwrap();
        let own = graph.nodes().iter().filter(|node| node.spec.plugin.is_none());
        let names = own.map(|node| node.spec.name);
        missing.extend(names.filter(|name| !pinned.iter().any(|pin| pin.behaviour.starts_with(&format!("{name} ")))));
    }
    assert_eq!(missing, Vec::<&str>::new());
}

#[test]
fn a_change_under_an_unchanged_key_is_told_with_what_to_raise() {
    let pin = |place: &str, behaviour: &str, key: &str, digest: &str| Pin {
        place: place.to_owned(),
        behaviour: behaviour.to_owned(),
        key: key.to_owned(),
        digest: digest.to_owned(),
    };
    let old = [
        pin("g a.x", "A 1 (c 1)", "k1", "d1"),
        pin("g b.x", "B 1 ()", "k2", "d2"),
    ];
    assert_eq!(read(&write(&old)), old);
    assert_eq!(compare(&old, &old), (vec![], vec![]));
    // Nothing raised: refused, also when the place has another name now.
    for place in ["g a.x", "g renamed.x"] {
        let (changed, _) = compare(&old, &[pin(place, "A 1 (c 1)", "k1", "other"), old[1].clone()]);
        assert_eq!(changed.len(), 1);
        assert!(
            changed[0].contains("Raise VERSION") && changed[0].contains("A 1 (c 1)"),
            "{changed:?}"
        );
    }
    // A key that two graphs share is pinned twice, and both count.
    let shared = [old[0].clone(), pin("h a.x", "A 1 (c 1)", "k1", "d1")];
    let (changed, _) = compare(&[pin("g a.x", "A 1 (c 1)", "k1", "forged"), shared[1].clone()], &shared);
    assert_eq!(changed.len(), 2, "{changed:?}");
    // Raised: stale, to be written anew. What is behind it has other inputs.
    let new = [
        pin("g a.x", "A 2 (c 1)", "k3", "other"),
        pin("g b.x", "B 1 ()", "k4", "d4"),
    ];
    let (changed, stale) = compare(&old, &new);
    assert_eq!(changed, Vec::<String>::new());
    assert_eq!(
        stale,
        [
            "g a.x: A 1 (c 1) -> A 2 (c 1)",
            "g b.x: its inputs or parameters are others"
        ]
    );
    assert_eq!(compare(&old, &old[..1]).1, ["g b.x: gone"]);
}
