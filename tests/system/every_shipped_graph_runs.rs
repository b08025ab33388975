//! Every graph that comes with gear is clean, and runs on a sample.

use gear_onnx::testing::{Net, can_run, onnx};
use gear_tests::Desk;

/// `@NAME` of all of them, the main one first.
fn names(desk: &Desk) -> Vec<String> {
    let list = desk.gear(&["graphs", "list"]).exits(0).stdout;
    let names: Vec<_> = list
        .lines()
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        // Experiments are no graphs; they have commands of their own.
        .filter(|name| !name.starts_with("@studies/") && !name.starts_with("@curves/"))
        .collect();
    assert!(names[0] == "@gear" && names.len() >= 8, "{list}");
    names
}

/// Whether a graph has nodes of plugins, which are not installed here.
fn needs_a_plugin(desk: &Desk, name: &str) -> bool {
    let nodes = desk.gear(&["nodes"]).exits(0).stdout;
    let absent: Vec<_> = nodes
        .lines()
        .filter(|line| line.contains("not installed)"))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(!absent.is_empty(), "{nodes}");
    let drawn = desk.gear(&["graph", name]).exits(0).stdout;
    absent.iter().any(|node| drawn.contains(&format!("<small>{node}<")))
}

/// For a graph that asks a network: `--input` and a small network of its kind, written into the folder.
fn network(desk: &Desk, name: &str) -> Option<[String; 2]> {
    let kind = name.strip_prefix("@networks/")?;
    let (input, net, answer) = match kind {
        "edges" => ("edge_network", Net::Edges, "edges"),
        "foreground" => ("mask_network", Net::Mean, "saliency"),
        "depth" => ("depth_network", Net::Mean, "{depth: {of: inverse}}"),
        "translate" => ("translate_network", Net::Negative, "picture"),
        other => panic!("no network for @networks/{other}"),
    };
    desk.file(&format!("{kind}.onnx"), onnx(&net));
    desk.file(&format!("{kind}.yaml"), format!("network: 1\nanswer: {answer}\n"));
    Some(["--input".to_owned(), format!("{input}={kind}.onnx")])
}

#[test]
fn all_of_them_run_and_what_they_share_runs_once() {
    let desk = Desk::new();
    for name in names(&desk) {
        // Graphs with services run in a module of their own, against a server.
        if needs_a_plugin(&desk, &name) || name.starts_with("@services/") {
            continue;
        }
        let network = network(&desk, &name);
        if network.is_some() && !can_run() {
            continue;
        }
        let mut arguments = vec!["run", &name, "--input", "painting=sample:court-lady"];
        arguments.extend(network.iter().flatten().map(String::as_str));
        let mut sets = vec!["painting.size=64", "orbit.orbit=4", "orbit.size=48"];
        if desk.gear(&["graph", &name]).exits(0).stdout.contains("<small>Refine<") {
            sets.extend(["refine.color_iterations=3", "refine.iterations=6"]);
        }
        for set in sets {
            arguments.extend(["--set", set]);
        }
        desk.gear(&arguments).exits(0);
        let metrics = gear_tests::json(&desk.path("out/metrics.json"));
        assert!(
            metrics["vend"].as_f64().is_some_and(|vend| vend > 0.0),
            "{name}: {metrics}"
        );
        if name != "@gear" && network.is_none() {
            let record = desk.record("out");
            let ran = record.with_status("ran");
            assert!(
                !ran.contains(&"foreground") && !ran.contains(&"edges"),
                "{name}: {ran:?}"
            );
        }
    }
}

#[test]
fn all_of_them_are_clean() {
    let desk = Desk::new();
    for name in names(&desk) {
        let done = desk.gear(&["check", &name]).exits(0);
        assert_eq!(done.stderr, "", "{name}");
    }
}

#[test]
fn what_is_resolved_is_the_same_work() {
    let desk = Desk::new();
    for name in names(&desk) {
        let resolved = desk.gear(&["graph", &name, "--resolved"]).exits(0).stdout;
        desk.file("resolved.yaml", &resolved);
        assert_eq!(desk.gear(&["check", "resolved.yaml"]).exits(0).stderr, "", "{name}");
        let plan = |graph: &str| {
            let mut arguments = vec!["plan", graph, "--input", "painting=sample:vessel"];
            let network = network(&desk, &name);
            arguments.extend(network.iter().flatten().map(String::as_str));
            desk.gear(&arguments).exits(0).stdout
        };
        assert_eq!(plan("resolved.yaml"), plan(&name), "{name}");
    }
}
