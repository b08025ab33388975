//! The binary runs a graph in which a node of gear feeds the team's own, and a value of the team's own type is kept.

use std::process::{Command, Output};

fn own_gear(folder: &std::path::Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_own-gear"))
        .args(arguments)
        .current_dir(folder)
        .env("GEAR_STORE", folder.join("store"))
        .output()
        .expect("the binary starts")
}

#[test]
fn a_graph_with_nodes_and_a_type_of_its_own_runs_and_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/palette.yaml");
    let run = |out: &str| {
        let arguments = [
            "run",
            graph,
            "--input",
            "painting=sample:vessel",
            "--set",
            "painting.size=96",
            "--out",
            out,
        ];
        let done = own_gear(folder.path(), &arguments);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{said}");
        said
    };
    run("first");
    let palette = std::fs::read(folder.path().join("first/palette.json")).unwrap();
    let tones: Vec<own_binary::Tone> = serde_json::from_slice(&palette).unwrap();
    assert!(!tones.is_empty() && tones.len() <= 5);
    assert!(folder.path().join("first/card.png").is_file());

    let again = run("again");
    assert!(again.contains("card: stored"), "{again}");
    assert_eq!(
        std::fs::read(folder.path().join("again/palette.json")).unwrap(),
        palette
    );
}

#[test]
fn its_nodes_are_listed_beside_those_of_gear() {
    let folder = tempfile::tempdir().unwrap();
    let list = own_gear(folder.path(), &["nodes"]).stdout;
    let list = String::from_utf8_lossy(&list);
    for name in ["ColourCard", "DominantColours", "LogRatio"] {
        assert!(list.contains(name), "{list}");
    }
}

#[test]
fn main_has_ten_lines() {
    let main = include_str!("../src/main.rs");
    assert!(main.lines().count() <= 10);
}
