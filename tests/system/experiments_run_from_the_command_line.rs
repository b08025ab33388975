//! Studies, curves and comparisons as a user types them.

use gear_tests::{Desk, json};

const STUDY: &str = "\
study: 1
title: Backs
graph: '@baselines/raw'
set: {painting.size: 48, metrics.ddi_size: 32, metrics.ddi_yaws: [30], metrics.view_yaws: [0]}
cases: {samples: {names: vessel, seed: [1, 2]}}
variants:
  shipped: {}
  flat-back: {set: {reconstruct.back: 0}}
measures:
  vend: {at: metrics.vend, better: more}
views: views
groups: motif
";

#[test]
fn a_study_says_what_it_will_do_does_it_and_has_nothing_left_to_do() {
    let desk = Desk::new();
    desk.file("backs.yaml", STUDY);
    desk.gear(&["check", "backs.yaml"]).exits(0);
    let forecast = desk.gear(&["study", "backs.yaml", "--dry-run"]).exits(0).stdout;
    // Per case: foreground is shared; reconstruct, views and metrics are each variant's own.
    assert!(
        forecast.contains("14 node executions instead of 16: 2 are shared"),
        "{forecast}"
    );
    assert!(desk.listing("study").is_empty());

    let done = desk.gear(&["study", "backs.yaml"]).exits(0);
    assert!(done.stderr.contains("14 nodes ran, no output twice"), "{done:#?}");
    let files = desk.listing("study");
    for name in [
        "rows.csv",
        "summary.csv",
        "study.md",
        "study.html",
        "study.json",
        "sheets/shipped.jpg",
        "views/vessel-1/flat-back/yaw+0.jpg",
    ] {
        assert!(files.iter().any(|file| file == name), "{name} in {files:?}");
    }
    let study = json(&desk.path("study/study.json"));
    assert_eq!(study["rows"].as_array().unwrap().len(), 4);
    assert!(study["rows"][0]["measures"]["vend"].as_f64().unwrap() > 0.0);

    let again = desk.gear(&["study", "backs.yaml"]).exits(0);
    assert!(again.stderr.contains("; 0 nodes ran"), "{again:#?}");
}

#[test]
fn the_mistakes_of_a_study_are_shown_where_they_stand() {
    let desk = Desk::new();
    desk.file(
        "backs.yaml",
        STUDY.replace("reconstruct.back: 0", "reconstruct.bakc: 0"),
    );
    for command in [&["check", "backs.yaml"][..], &["study", "backs.yaml", "--dry-run"]] {
        let said = desk.gear(command).exits(2).stderr;
        assert!(
            said.contains("did you mean `back`?") && said.contains("backs.yaml:8:"),
            "{said}"
        );
    }
    let told = desk.gear(&["check", "backs.yaml", "--format", "json"]).exits(2).stdout;
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!(told["mistakes"][0]["start"]["line"], 8);
}

#[test]
fn a_picture_that_cannot_be_read_is_a_row() {
    let desk = Desk::new();
    desk.file("broken.png", "no picture");
    let cases = "cases: {files: '*.png'}";
    desk.file(
        "backs.yaml",
        STUDY
            .replace("cases: {samples: {names: vessel, seed: [1, 2]}}", cases)
            .replace("groups: motif\n", ""),
    );
    desk.gear(&["study", "backs.yaml"]).exits(1).says("2 of 2 rows failed");
    let rows = std::fs::read_to_string(desk.path("study/rows.csv")).unwrap();
    assert!(rows.contains("broken") && rows.contains("painting"), "{rows}");
}

#[test]
fn a_file_that_is_missing_is_a_row_and_a_file_is_one_case() {
    let desk = Desk::new();
    desk.gear(&["sample", "vessel", "--size", "64", "--out", "s"]).exits(0);
    desk.file("collection.csv", "file\ngone.png\n");
    let cases = "cases: {manifest: collection.csv, files: ['s/paint*.png', 's/p*.png']}";
    let text = STUDY
        .replace("cases: {samples: {names: vessel, seed: [1, 2]}}", cases)
        .replace("views: views\ngroups: motif\n", "");
    desk.file("backs.yaml", &text);
    desk.gear(&["study", "backs.yaml"]).exits(1).says("2 of 4 rows failed");
    let rows = std::fs::read_to_string(desk.path("study/rows.csv")).unwrap();
    assert!(rows.contains("gone.png: there is no such file"), "{rows}");
    let tables = std::fs::read_to_string(desk.path("study/study.md")).unwrap();
    assert!(
        tables.contains("(1 of 2)") && tables.contains("over 2 cases, or"),
        "{tables}"
    );
}

#[test]
fn a_measure_that_a_report_lacks_fails_its_rows() {
    let desk = Desk::new();
    let text = STUDY.replace(
        "measures:\n",
        "measures:\n  typo: metrics.vendd\n  niqe: metrics.niqe.views_average\n",
    );
    desk.file(
        "backs.yaml",
        text.replace("seed: [1, 2]", "seed: 1").replace("views: views\n", ""),
    );
    let said = desk.gear(&["study", "backs.yaml"]).exits(1);
    let rows = std::fs::read_to_string(desk.path("study/rows.csv")).unwrap();
    for says in ["measure `typo`", "has no `vendd`", "did you mean `vend`?"] {
        assert!(rows.contains(says), "{says} in {rows} {said:#?}");
    }
    // What is there and undefined, as the naturalness of a tiny picture, is no failure.
    desk.file(
        "backs.yaml",
        text.replace("  typo: metrics.vendd\n", "")
            .replace("views: views\n", ""),
    );
    desk.gear(&["study", "backs.yaml"])
        .exits(0)
        .says("`niqe` is undefined in 4 of 4 rows");
}

#[test]
fn two_runs_are_compared_by_what_they_left() {
    let desk = Desk::new();
    desk.file(
        "small.yaml",
        "gear: 1\ninputs: {painting: {type: Image, with: {size: 48}}}\nnodes:\n  ratio: {node: LogRatio, in: {image: painting}}\n\
         outputs: {ratio: ratio.ratio, smooth: ratio.smooth}\n",
    );
    for (out, radius) in [("a", "0.03"), ("b", "0.2")] {
        let set = format!("ratio.radius={radius}");
        desk.gear(&[
            "run",
            "small.yaml",
            "--input",
            "painting=sample:vessel",
            "--set",
            &set,
            "--out",
            out,
        ])
        .exits(0);
    }
    let told = desk.gear(&["diff", "a", "b"]).exits(0).stdout;
    for says in [
        "ratio.radius: 0.03 → 0.2",
        "smooth (Field): max",
        "1 of 2 outputs is the same",
    ] {
        assert!(told.contains(says), "{says} in {told}");
    }
    desk.gear(&["diff", "a", "b", "--exit-code"]).exits(1);
    desk.gear(&["diff", "a", "a", "--exit-code"]).exits(0);
    // Without the store, the exact files serve.
    std::fs::remove_dir_all(desk.path("store")).unwrap();
    assert_eq!(desk.gear(&["diff", "a", "b"]).exits(0).stdout, told);
    desk.gear(&["diff", "a", "nothing"]).exits(2).says("run.json");
}

#[test]
fn a_curve_is_measured_and_its_table_drawn_again() {
    let desk = Desk::new();
    desk.file(
        "window.yaml",
        "curve: 1\ntitle: Window\ngraph: '@gear'\nset: {painting.size: 64}\npicture: 'sample:vessel'\n\
         outputs: {smooth: ratio.smooth}\nknobs: {radius: {at: ratio.radius, values: [0.01, 0.1]}}\n\
         reference: {ratio.radius: 0.3}\ntime: ratio\nerror: {of: smooth, norm: rms}\nrepeats: 1\n",
    );
    desk.gear(&["curve", "window.yaml", "--out", "one"]).exits(0);
    let table = std::fs::read_to_string(desk.path("one/window.csv")).unwrap();
    assert_eq!(
        table.lines().filter(|line| !line.starts_with('#')).count(),
        4,
        "{table}"
    );
    assert!(table.contains("radius = 0.03,") && table.contains(",yes"), "{table}");
    let dry = ["curve", "one/window.csv", "--out", "two", "--dry-run"];
    assert!(desk.gear(&dry).exits(0).stdout.contains("window.svg would be drawn"));
    assert!(!desk.path("two").exists());
    desk.gear(&["curve", "one/window.csv", "--out", "two"]).exits(0);
    for name in ["window.csv", "window.svg"] {
        let read = |out: &str| std::fs::read_to_string(desk.path(out).join(name)).unwrap();
        assert_eq!(read("one"), read("two"));
    }
}
