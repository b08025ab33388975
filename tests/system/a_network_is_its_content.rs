//! A network is known by what is in its files, never by where they lie, and touches nothing that does not ask it.

use gear_onnx::testing::{Net, can_run, onnx};
use gear_tests::Desk;

const GRAPH: &str = "\
gear: 1
inputs:
  painting: {type: Image, with: {size: 48}}
  lines: {type: Model, optional: true}
nodes:
  edges: {node: EdgeDetect, in: {image: painting, model: lines}, with: {method: network}}
outputs:
  edges: edges.edges
";

fn run(desk: &Desk, more: &[&str]) -> (i32, Vec<String>, String) {
    desk.file("graph.yaml", GRAPH);
    let all = [&["run", "graph.yaml", "--input", "painting=sample:vessel"][..], more].concat();
    let done = desk.gear(&all);
    let code = done.code.unwrap();
    let ran = if code == 0 {
        desk.record("out")
            .with_status("ran")
            .iter()
            .map(ToString::to_string)
            .collect()
    } else {
        Vec::new()
    };
    (code, ran, done.stderr)
}

fn ran(desk: &Desk, more: &[&str]) -> Vec<String> {
    let (code, ran, stderr) = run(desk, more);
    assert_eq!(code, 0, "{stderr}");
    ran
}

#[test]
fn moving_it_changes_nothing_and_its_declaration_is_part_of_it() {
    if !can_run() {
        return;
    }
    let desk = Desk::new();
    desk.file("a.onnx", onnx(&Net::Edges));
    desk.file("a.yaml", Net::Edges.declaration());
    assert_eq!(ran(&desk, &["--input", "lines=a.onnx"]), ["edges", "lines", "painting"]);
    desk.file("b.onnx", onnx(&Net::Edges));
    desk.file("b.yaml", Net::Edges.declaration());
    assert_eq!(ran(&desk, &["--input", "lines=b.onnx"]), [""; 0]);
    desk.file("b.yaml", "# a remark\nnetwork: 1\nlicence: own\nanswer: edges\n");
    assert_eq!(
        ran(&desk, &["--input", "lines=b.onnx"]),
        ["lines"],
        "read again, and the same"
    );
    desk.file("b.yaml", "network: 1\nlicence: own\nwhite: 255\nanswer: edges\n");
    assert_eq!(ran(&desk, &["--input", "lines=b.onnx"]), ["edges", "lines"]);
    let record = std::fs::read_to_string(desk.path("out/run.json")).unwrap();
    assert!(record.contains("ort:1."), "the realm is in the record");
}

#[test]
fn an_embedded_method_has_the_same_key_with_and_without_it() {
    let desk = Desk::new();
    let embedded = ["--set", "edges.method=canny"];
    assert_eq!(ran(&desk, &embedded), ["edges", "painting"]);
    desk.file("a.onnx", onnx(&Net::Edges));
    desk.file("a.yaml", Net::Edges.declaration());
    assert_eq!(
        ran(&desk, &[&embedded[..], &["--input", "lines=a.onnx"]].concat()),
        [""; 0]
    );
}

#[test]
fn a_mistake_is_told_where_it_stands() {
    let desk = Desk::new();
    desk.file("a.onnx", onnx(&Net::Edges));
    desk.file("a.yaml", "network: 1\nanswer: edge\n");
    let (code, _, stderr) = run(&desk, &["--input", "lines=a.onnx"]);
    assert_ne!(code, 0);
    assert!(
        stderr.contains("did you mean `edges`?") && stderr.contains("a.yaml:2"),
        "{stderr}"
    );
    let (code, _, stderr) = run(&desk, &[]);
    assert_ne!(code, 0);
    assert!(stderr.contains("--input NAME=FILE"), "{stderr}");
}

#[test]
fn a_library_that_is_none_is_told_with_how_to_get_one() {
    let desk = Desk::new();
    desk.file("a.onnx", onnx(&Net::Edges));
    desk.file("a.yaml", Net::Edges.declaration());
    desk.file("libonnxruntime.so", "no library");
    let library = desk.path("libonnxruntime.so");
    let library = library.to_str().unwrap();
    let (code, _, stderr) = run(&desk, &["--input", "lines=a.onnx", "--onnxruntime", library]);
    assert_eq!(code, 1, "{stderr}");
    assert!(
        stderr.contains("pip install onnxruntime") && !stderr.contains("panicked"),
        "{stderr}"
    );
}

#[test]
fn a_network_that_gear_knows_needs_a_word_and_no_declaration() {
    let desk = Desk::new();
    desk.file("a.onnx", onnx(&Net::Edges));
    let (code, _, stderr) = run(&desk, &["--input", "lines=a.onnx"]);
    assert_eq!(code, 2);
    assert!(stderr.contains("`known_as` (pidinet, u2netp,"), "{stderr}");
    let known = |set| ["--input", "lines=a.onnx", "--set", set];
    let (code, _, stderr) = run(&desk, &known("lines.known_as=pidinett"));
    assert_eq!(code, 2);
    assert!(stderr.contains("did you mean `pidinet`?"), "{stderr}");
    if can_run() {
        let ran = ran(&desk, &known("lines.known_as=pidinet"));
        assert!(ran.contains(&"edges".to_owned()), "{ran:?}");
    }
}
