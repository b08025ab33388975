//! The catalogue of stiff and extreme cases holds no surprise: at every registered node, for every value of the types of its
//! ports, the outcome is the one that the catalogue has, within the tolerance to the f64 reference where there is one.

use std::path::Path;

use gear_study::stress::{self, Catalogue, Options, Row};
use gear_tests::Desk;

/// The scene of a million Gaussians takes a minute in all nodes; `gear stress` has it.
const LARGEST: usize = 8 << 20;

#[test]
fn no_node_and_no_case_is_a_surprise() {
    let registry = gear_cli::registry();
    let catalogue = Catalogue::shipped(&registry).unwrap();
    let options = Options {
        largest: LARGEST,
        ..Options::default()
    };
    let mut rows: Vec<Row> = Vec::new();
    for node in registry.nodes() {
        rows.extend(stress::stress_node(&catalogue, node, &Default::default(), &options, &mut |_| {}).unwrap());
    }
    rows.extend(
        catalogue
            .cases
            .iter()
            .map(|case| stress::stress_case(&catalogue, case, &registry, &options)),
    );
    let surprises: Vec<_> = rows
        .iter()
        .filter(|row| row.surprise.is_some())
        .map(stress::text)
        .collect();
    assert!(surprises.is_empty(), "{}", surprises.join("\n"));
    assert!(rows.len() > 400 && rows.iter().filter(|row| row.error.is_some()).count() > 40);
}

#[test]
fn every_registered_node_is_in_the_catalogue() {
    let registry = gear_cli::registry();
    let catalogue = Catalogue::shipped(&registry).unwrap();
    let missing: Vec<_> = registry
        .nodes()
        // What a service answers, or that there is none, is not for the catalogue to say.
        .filter(|node| node.spec.deterministic)
        .map(|node| node.spec.name)
        .filter(|name| !catalogue.nodes.contains_key(*name))
        .collect();
    assert!(
        missing.is_empty(),
        "add to crates/gear-study/src/stress/catalogue.yaml: {missing:?}"
    );
}

/// `gear stress --catalogue` prints what stands between the marks.
#[test]
fn the_book_has_the_catalogue() {
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/stress.md");
    let book = std::fs::read_to_string(book).unwrap();
    let (_, rest) = book.split_once("<!-- gear stress --catalogue -->\n").unwrap();
    let (table, _) = rest.split_once("<!-- end -->").unwrap();
    let printed = Desk::new().gear(&["stress", "--catalogue"]).exits(0).stdout;
    assert_eq!(
        table.trim(),
        printed.trim(),
        "docs/src/stress.md is not what `gear stress --catalogue` prints"
    );
}

#[test]
fn the_command_tells_rows_and_exits_by_surprises() {
    let desk = Desk::new();
    let done = desk.gear(&["stress", "Pyramid"]).exits(0);
    assert!(
        done.stdout.contains("ratio = field/tiny and huge") && done.stdout.contains("f64 "),
        "{}",
        done.stdout
    );
    assert!(done.stderr.contains("0 surprises"), "{}", done.stderr);
    let json = desk.gear(&[
        "stress",
        "AdaptiveGain",
        "--set",
        "mode={fixed: {alpha: 2.0}}",
        "--format",
        "json",
    ]);
    let json: serde_json::Value = serde_json::from_str(&json.exits(0).stdout).unwrap();
    assert!(json["rows"].as_array().unwrap().len() > 20);
    desk.file("small.yaml", crate::SMALL);
    let graph = desk.gear(&["stress", "small.yaml"]).exits(0);
    assert!(graph.stdout.contains("painting = image/one NaN"), "{}", graph.stdout);
    assert!(
        desk.gear(&["stress", "Pyramidd"])
            .exits(2)
            .stderr
            .contains("did you mean `Pyramid`?")
    );
}
