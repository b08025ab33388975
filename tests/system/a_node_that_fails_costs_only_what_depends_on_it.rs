//! A failure is told with its node, its inputs and its cause; what does not depend on it is finished and kept.

use gear_tests::Desk;

/// `gain` fails: its two inputs differ in size. `after` depends on it, `edges` does not.
const BROKEN: &str = "\
gear: 1
inputs:
  painting: {type: Image, with: {size: 64}}
  smaller: {type: Image, with: {size: 48}}
nodes:
  here:  {node: LogRatio, in: {image: painting}}
  there: {node: LogRatio, in: {image: smaller}}
  gain:  {node: AdaptiveGain, in: {multiscale: here.ratio, smooth: there.smooth}}
  after: {node: Pyramid, in: {ratio: gain.ratio, edges: edges.edges}}
  edges: {node: EdgeDetect, in: {image: painting}}
outputs:
  ratio: after.ratio
  edges: edges.edges
";

const RUN: &[&str] = &[
    "run",
    "broken.yaml",
    "--input",
    "painting=sample:vessel",
    "--input",
    "smaller=sample:vessel",
    "--jobs",
    "1",
];

fn desk() -> Desk {
    let desk = Desk::new();
    desk.file("broken.yaml", BROKEN);
    desk
}

#[test]
fn the_rest_is_finished_and_kept_and_the_next_run_has_it_at_once() {
    for flags in [&[][..], &["--keep-going"]] {
        let desk = desk();
        desk.gear(&[RUN, flags].concat())
            .exits(1)
            .says("node `gain` (AdaptiveGain) failed")
            .says("expected the size of `multiscale`")
            .says("multiscale: Field from here.ratio")
            .says("smooth: Field from there.smooth");
        let record = desk.record("out");
        assert_eq!(record.with_status("failed"), ["gain"]);
        assert_eq!(record.with_status("skipped"), ["after"]);
        assert!(record.with_status("ran").contains(&"edges"));
        assert!(desk.listing("out").iter().any(|file| file.starts_with("edges.")));
        assert!(!desk.listing("out").iter().any(|file| file.starts_with("ratio.")));
        desk.gear(&[RUN, flags].concat()).exits(1);
        let again = desk.record("out");
        assert_eq!(again.with_status("ran"), Vec::<&str>::new());
        assert!(again.with_status("cached").contains(&"edges"));
    }
}

#[test]
fn fail_fast_starts_nothing_more() {
    let desk = desk();
    // A long row behind `edges`, so that much is left to do when `gain` fails.
    let mut text = BROKEN.replace("outputs:\n", "");
    text.truncate(text.find("  ratio: after").unwrap());
    for i in 0..40 {
        let from = if i == 0 {
            "painting".to_owned()
        } else {
            format!("e{}.image", i - 1)
        };
        text += &format!("  e{i}: {{node: Enhance, in: {{image: {from}}}}}\n");
    }
    text += "outputs:\n  ratio: after.ratio\n  last: e39.image\n";
    desk.file("broken.yaml", text);
    desk.gear(&[RUN, &["--fail-fast"]].concat()).exits(1);
    let record = desk.record("out");
    assert_eq!(record.with_status("failed"), ["gain"]);
    assert!(
        !record.with_status("unfinished").is_empty(),
        "{:?}",
        record.with_status("ran")
    );
    desk.gear(&[RUN, &["--fail-fast", "--keep-going"]].concat()).exits(2);
}

#[test]
fn a_memory_limit_changes_no_result() {
    let desk = Desk::new();
    let run = |out: &str, limit: &[&str]| {
        desk.gear(&[crate::MAIN, &["--no-cache", "--out", out], limit].concat())
            .exits(0);
        desk.record(out)
    };
    let free = run("free", &[]);
    let tight = run("tight", &["--memory", "64KiB"]);
    assert_eq!(free.outputs(), tight.outputs());
    assert_eq!(tight.0["memory"]["limit"], 64 << 10);
    let text = tight.0.to_string();
    assert!(text.contains("above the limit of 1 MiB"), "{text}");
    desk.gear(&[crate::MAIN, &["--memory", "much"]].concat())
        .exits(2)
        .says("expected a number of bytes");
}
