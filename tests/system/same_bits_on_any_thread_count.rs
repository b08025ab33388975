//! The same bits on any number of threads.

use gear_tests::Desk;

use crate::MAIN;

#[test]
fn the_main_job_with_one_two_and_eight_threads() {
    let desk = Desk::new();
    let run = |jobs: &str| {
        let out = format!("out{jobs}");
        desk.gear(&[MAIN, &["--no-cache", "--jobs", jobs, "--out", &out]].concat())
            .exits(0);
        desk.record(&out)
    };
    let one = run("1");
    assert!(one.outputs().len() >= 6);
    for jobs in ["2", "8"] {
        let other = run(jobs);
        assert_eq!(one.outputs(), other.outputs(), "{jobs} threads");
        let scene = |out: &str| std::fs::read(desk.path(out).join("scene.ply")).unwrap();
        assert!(scene("out1") == scene(&format!("out{jobs}")), "{jobs} threads");
    }
}
