//! Every graph that comes with gear is clean, and runs on a sample.

use gear_tests::Desk;

#[test]
fn the_baselines() {
    let desk = Desk::new();
    for graph in [
        "@baselines/raw",
        "@baselines/histogram-equalization",
        "@baselines/retinex",
    ] {
        let arguments = [
            "run",
            graph,
            "--input",
            "painting=sample:court-lady",
            "--set",
            "painting.size=64",
            "--set",
            "orbit.orbit=4",
            "--set",
            "orbit.size=48",
        ];
        desk.gear(&arguments).exits(0);
        let metrics = gear_tests::json(&desk.path("out/metrics.json"));
        assert!(
            metrics["vend"].as_f64().is_some_and(|vend| vend > 0.0),
            "{graph}: {metrics}"
        );
    }
}

#[test]
fn all_of_them_are_clean() {
    let desk = Desk::new();
    let list = desk.gear(&["graphs", "list"]).exits(0).stdout;
    let names: Vec<_> = list.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"@gear") && names.len() >= 4, "{list}");
    for name in names {
        let done = desk.gear(&["check", name]).exits(0);
        assert_eq!(done.stderr, "", "{name}");
    }
}
