//! What each command says, and where it says it.

use std::process::Stdio;

use gear_tests::Desk;

#[test]
fn help_and_version_go_to_standard_output() {
    let desk = Desk::new();
    for flag in ["--help", "--version"] {
        let done = desk.gear(&[flag]).exits(0);
        assert!(done.stdout.contains("gear"));
        assert_eq!(done.stderr, "");
    }
    let help = desk.gear(&["--help"]).stdout;
    assert!(help.starts_with("Turns one classical painting into"), "{help}");
    assert!(help.contains("Exit codes") && help.contains("130"), "{help}");
    let done = desk.gear(&["fly"]).exits(2);
    assert_eq!(done.stdout, "");
}

#[test]
fn nodes_lists_them_and_shows_one() {
    let desk = Desk::new();
    let list = desk.gear(&["nodes"]).exits(0).stdout;
    for name in [
        "EdgeDetect",
        "Foreground",
        "Recompose",
        "Reconstruct",
        "Refine",
        "Metrics",
    ] {
        assert!(list.contains(name), "{list}");
    }
    let one = desk.gear(&["nodes", "LogRatio"]).exits(0).stdout;
    for word in [
        "inputs",
        "image",
        "outputs",
        "ratio",
        "smooth",
        "parameters",
        "radius",
        "default",
    ] {
        assert!(one.contains(word), "{word} in {one}");
    }
    desk.gear(&["nodes", "LogRatoi"]).exits(2).says("LogRatio");
    for (input, word) in [("Image", "768"), ("Mask", "4096")] {
        let shown = desk.gear(&["nodes", input]).exits(0).stdout;
        assert!(shown.contains("size") && shown.contains(word), "{shown}");
    }
    desk.gear(&["nodes", "Imag"]).exits(2).says("Image");
}

#[test]
fn the_reference_is_written_of_all_nodes_or_one() {
    let desk = Desk::new();
    let all = desk.gear(&["nodes", "--markdown"]).exits(0).stdout;
    for heading in ["# Reference", "### LogRatio", "## Values", "### Mask, as a file"] {
        assert!(all.lines().any(|line| line == heading), "{heading} in {all}");
    }
    let one = desk.gear(&["nodes", "LogRatio", "--markdown"]).exits(0).stdout;
    assert!(
        one.starts_with("# LogRatio\n") && one.contains("- `radius` (a number; 0 to 50"),
        "{one}"
    );
}

#[test]
fn a_new_node_with_a_bad_name_or_port_is_refused_in_one_sentence() {
    let desk = Desk::new();
    for (arguments, says) in [
        (&["oil-glaze"][..], "did you mean `OilGlaze`?"),
        (&["LogRatio"], "already"),
        (&["OilGlaze", "--input", "image:Imag"], "did you mean `Image`?"),
        (&["OilGlaze", "--output", "fn:Image"], "word of the Rust language"),
        (&["OilGlaze", "--gear", "nowhere"], "not gear's repository"),
    ] {
        let refused = desk.gear(&[&["new-node"], arguments].concat()).exits(2).says(says);
        assert_eq!(refused.stderr.lines().count(), 1, "{}", refused.stderr);
        assert!(
            refused.stderr.trim_end().ends_with("nothing was written"),
            "{}",
            refused.stderr
        );
    }
    assert_eq!(desk.listing("."), Vec::<String>::new());
}

#[test]
fn a_graph_is_drawn() {
    let desk = Desk::new();
    let mermaid = desk.gear(&["graph", "@gear", "--format", "mermaid"]).exits(0).stdout;
    assert!(
        mermaid.starts_with("flowchart") && mermaid.contains("recompose"),
        "{mermaid}"
    );
    let dot = desk.gear(&["graph", "@gear", "--format", "dot"]).exits(0).stdout;
    assert!(dot.contains("digraph") && dot.contains("recompose"), "{dot}");
}

#[test]
fn mistakes_for_programs_are_json_on_standard_output() {
    let desk = Desk::new();
    let check = |graph: &str, code| {
        let done = desk.gear(&["check", graph, "--format", "json"]).exits(code);
        assert_eq!(done.stderr, "", "{graph}");
        serde_json::from_str::<serde_json::Value>(&done.stdout).unwrap()
    };
    let clean = check("@ablations/fixed-gain", 0);
    assert_eq!(clean["mistakes"], serde_json::json!([]));
    assert_eq!(clean["files"], serde_json::json!(["@ablations/fixed-gain", "@gear"]));

    desk.file(
        "over.yaml",
        "gear: 1\nextends: small.yaml\nnodes:\n  ratio: {with: {radios: 0.1}}\n",
    );
    desk.file("small.yaml", crate::SMALL);
    let wrong = check("over.yaml", 2);
    assert_eq!((&wrong["format"], &wrong["errors"]), (&1.into(), &1.into()));
    let mistake = &wrong["mistakes"][0];
    assert_eq!(mistake["code"], "unknown-parameter");
    assert_eq!(mistake["file"], "over.yaml");
    assert_eq!(
        mistake["start"],
        serde_json::json!({"line": 4, "column": 18, "offset": 52})
    );
    assert_eq!(
        mistake["end"],
        serde_json::json!({"line": 4, "column": 24, "offset": 58})
    );

    let missing = check("smal.yaml", 2);
    assert_eq!(missing["mistakes"][0]["code"], "unreadable-graph");
    assert_eq!(missing["mistakes"][0]["help"], "did you mean `small.yaml`?");
}

#[test]
fn the_schema_knows_the_nodes() {
    let desk = Desk::new();
    let schema: serde_json::Value = serde_json::from_str(&desk.gear(&["schema"]).exits(0).stdout).unwrap();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    let radius = &schema["$defs"]["node-LogRatio"]["properties"]["with"]["properties"]["radius"];
    assert!(
        radius["description"].as_str().unwrap().contains("Default"),
        "{radius:#}"
    );
}

#[test]
fn a_shipped_graph_is_copied_but_never_over_a_file() {
    let desk = Desk::new();
    desk.gear(&["graphs", "copy", "gear.yaml"]).exits(0);
    desk.gear(&["check", "gear.yaml"]).exits(0);
    desk.file("gear.yaml", "mine");
    desk.gear(&["graphs", "copy", "gear"]).exits(2).says("gear.yaml");
    assert_eq!(std::fs::read(desk.path("gear.yaml")).unwrap(), b"mine");
    desk.gear(&["graphs", "copy", "--to", "all"]).exits(0);
    assert!(desk.listing("all").contains(&"baselines/raw.yaml".to_owned()));
}

#[test]
fn a_sample_comes_with_its_truth() {
    let desk = Desk::new();
    desk.gear(&["sample", "court-lady", "--size", "64", "--out", "lady"])
        .exits(0);
    let files = desk.listing("lady");
    for name in ["painting.png", "mask.png", "depth.exr", "height.exr", "normals.png"] {
        assert!(files.contains(&name.to_owned()), "{name} in {files:?}");
    }
    desk.gear(&["sample", "cat", "--out", "cat"])
        .exits(2)
        .says("court-lady");
    desk.gear(&["sample", "vessel", "--size", "0", "--out", "cat"])
        .exits(2)
        .says("16");
    assert_eq!(desk.listing("cat"), Vec::<String>::new());
}

#[test]
fn samples_are_listed() {
    let desk = Desk::new();
    let list = desk.gear(&["sample"]).exits(0).stdout;
    let motifs = gear_sample::names().iter().map(ToString::to_string);
    let all: Vec<String> = motifs.chain(gear_sample::benchmark()).collect();
    assert_eq!(list.lines().collect::<Vec<_>>(), all);
    let families = desk.gear(&["sample", "--list"]).exits(0).stdout;
    for said in ["figure-1", "landscape-8", "upper-left", "condition="] {
        assert!(families.contains(said), "{said} in {families}");
    }
    desk.gear(&["sample", "vessel"]).exits(2).says("--out");
}

#[test]
fn a_plan_takes_the_arguments_of_a_run_and_writes_nothing() {
    let desk = Desk::new();
    let arguments = [
        &["plan"],
        &crate::MAIN[1..],
        &["--input", "mask=sample:vessel", "--out", "out"],
    ]
    .concat();
    let plan = desk.gear(&arguments).exits(0).stdout;
    assert!(plan.contains("recompose"), "{plan}");
    assert_eq!(desk.listing("out"), Vec::<String>::new());
}

#[test]
fn a_log_has_a_line_a_node_unless_it_is_to_be_quiet() {
    let desk = Desk::new();
    desk.file("graph.yaml", crate::SMALL);
    let run = |more: &[&str]| {
        let arguments = ["run", "graph.yaml", "--input", "painting=sample:vessel"];
        desk.gear(&[&arguments[..], more].concat()).exits(0)
    };
    let first = run(&[]);
    for node in ["painting", "edges", "ratio", "pyramid", "enhance"] {
        let lines = first
            .stderr
            .lines()
            .filter(|line| line.starts_with(&format!("{node}: ")));
        assert_eq!(lines.count(), 1, "{node} in {}", first.stderr);
    }
    run(&[]).says("pyramid: stored");
    assert_eq!(run(&["--quiet"]).stderr, "");
    assert!(
        first.stdout.lines().all(|line| line.starts_with("out")),
        "{}",
        first.stdout
    );
}

#[test]
fn files_of_an_earlier_run_do_not_stay_beside_those_of_the_next() {
    let desk = Desk::new();
    desk.file("graph.yaml", crate::SMALL);
    let arguments = ["run", "graph.yaml", "--input", "painting=sample:vessel", "--out", "out"];
    desk.gear(&arguments).exits(0);
    desk.file("out/notes.txt", "mine");
    assert!(desk.listing("out").contains(&"edges.exr".to_owned()));
    desk.gear(&[&arguments[..], &["--output", "enhanced"]].concat())
        .exits(0)
        .says("4 files of an earlier run were removed");
    assert_eq!(
        desk.listing("out"),
        ["enhanced.png", "notes.txt", "report.html", "run.json"]
    );
}

#[cfg(target_os = "linux")]
#[test]
fn results_that_reach_nobody_are_an_error() {
    let desk = Desk::new();
    for arguments in [&["nodes"][..], &["--help"], &["graphs", "list"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let done: gear_tests::Done = desk.command(arguments).stdout(full).output().unwrap().into();
        done.exits(1).says("standard output");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let desk = Desk::new();
    let mut child = desk
        .command(&["nodes"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert_eq!(output.status.code(), Some(0));
}

/// Where threads are scarce, a run has fewer of them; where there are none, it says so.
#[cfg(target_os = "linux")]
#[test]
fn threads_that_cannot_be_started_are_told_of() {
    let desk = Desk::new();
    desk.file("small.yaml", crate::SMALL);
    let run = [
        "run",
        "small.yaml",
        "--input",
        "painting=sample:vessel",
        "--device",
        "cpu",
        "--jobs",
        "256",
    ];
    // Every thread of a run reserves 16 MiB of addresses; so many of them do not fit.
    let limited = |kibibytes: u32, arguments: &[&str]| -> gear_tests::Done {
        let gear = desk.command(arguments);
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", &format!("ulimit -v {kibibytes}; exec \"$@\""), "sh"]);
        shell.arg(gear.get_program()).args(gear.get_args());
        shell.current_dir(desk.path("")).env("GEAR_STORE", desk.path("store"));
        shell.output().unwrap().into()
    };
    let done = limited(2 << 20, &run).exits(0).says("of 256 threads only");
    assert!(!done.stderr.contains("panicked"), "{done:?}");
}
