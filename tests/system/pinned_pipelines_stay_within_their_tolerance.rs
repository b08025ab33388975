//! The project's own pipelines are pinned as a user's would be, and `gear snap` tells what moved.

use std::path::{Path, PathBuf};

use gear_tests::Desk;

fn graphs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/snapshots")
}

#[test]
fn the_shipped_pipelines_are_as_they_were_pinned() {
    let desk = Desk::new();
    let mut checked = 0;
    for entry in std::fs::read_dir(graphs()).unwrap().flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|extension| extension == "yaml") {
            desk.gear(&["snap", &path.display().to_string(), "--check"]).exits(0);
            checked += 1;
        }
    }
    assert!(checked >= 3);
}

const PINNED: &str = "\
gear: 1
inputs:
  painting: {type: Image, with: {size: 64}}
nodes:
  ratio: {node: LogRatio, in: {image: painting}, with: {radius: 0.03}}
outputs:
  ratio: ratio.ratio
snapshots:
  smooth: {port: ratio.smooth, norm: max, tolerance: 0.01}
  ratio: ratio.ratio
";

#[test]
fn a_change_is_told_with_its_size_and_a_page_and_is_taken_on_demand() {
    let desk = Desk::new();
    desk.file("p.yaml", PINNED);
    let missing = desk
        .gear(&["snap", "p.yaml", "--check", "--input", "painting=sample:vessel"])
        .exits(1);
    assert!(missing.stdout.contains("MISSING"), "{}", missing.stdout);
    assert!(
        !desk.path("p.snapshots").exists() && !desk.path("snapshots.html").exists(),
        "a check writes nothing"
    );
    desk.gear(&["snap", "p.yaml", "--input", "painting=sample:vessel"])
        .exits(0);
    let files = [
        "ratio.exr",
        "ratio.json",
        "ratio.png",
        "smooth.exr",
        "smooth.json",
        "smooth.png",
    ];
    assert_eq!(desk.listing("p.snapshots"), files);
    // The inputs are remembered.
    desk.gear(&["snap", "p.yaml", "--check"]).exits(0);

    desk.file("p.yaml", PINNED.replace("radius: 0.03", "radius: 0.2"));
    let moved = desk.gear(&["snap", "p.yaml", "--check"]).exits(1);
    let line = moved.stdout.lines().find(|line| line.starts_with("smooth")).unwrap();
    assert!(line.contains("MOVED") && line.contains("max ≤ 1e-2"), "{line}");
    assert!(
        moved
            .stdout
            .lines()
            .any(|line| line.starts_with("ratio") && line.contains("same")),
        "{}",
        moved.stdout
    );
    let page = std::fs::read_to_string(desk.path("snapshots.html")).unwrap();
    assert!(page.contains("before") && page.contains("after") && page.contains("difference"));
    desk.gear(&["snap", "p.yaml"]).exits(1); // without --accept nothing that is pinned is replaced
    desk.gear(&["snap", "p.yaml", "--accept", "smooth"]).exits(0);
    desk.gear(&["snap", "p.yaml", "--check"]).exits(0);

    desk.file(
        "p.yaml",
        PINNED
            .replace("  ratio: ratio.ratio\n", "")
            .replace("outputs:\n", "outputs:\n  r: ratio.ratio\n"),
    );
    let unknown = desk.gear(&["snap", "p.yaml", "--check"]);
    assert!(unknown.stderr.contains("`ratio` is pinned"), "{}", unknown.stderr);
    let stale = desk
        .gear(&["snap", "p.yaml", "--check", "--input", "painting=sample:court-lady"])
        .exits(1);
    assert!(stale.stdout.contains("STALE"), "{}", stale.stdout);
}

#[test]
fn what_cannot_be_pinned_is_said() {
    let desk = Desk::new();
    assert!(
        desk.gear(&["snap", "@gear"])
            .exits(2)
            .stderr
            .contains("extends: '@gear'")
    );
    desk.file("p.yaml", PINNED);
    let lost = desk.gear(&[
        "snap",
        "p.yaml",
        "--accept",
        "smoth",
        "--input",
        "painting=sample:vessel",
    ]);
    assert!(lost.exits(2).stderr.contains("did you mean `smooth`?"));
    desk.file("none.yaml", PINNED.split("snapshots:").next().unwrap());
    assert!(
        desk.gear(&["snap", "none.yaml"])
            .exits(2)
            .stderr
            .contains("pins nothing")
    );
}
