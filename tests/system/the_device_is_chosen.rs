//! `--device` says what rasterises, results are keyed with it, and the CPU stands behind the GPU.

use gear_tests::{Desk, Done, Record};

use crate::MAIN;

/// The main job without most of its refinement.
const SHORT: &[&str] = &["--output", "views", "--set", "refine.iterations=2"];

fn views(desk: &Desk, device: &str, out: &str) -> Done {
    desk.gear(&[MAIN, SHORT, &["--device", device, "--out", out]].concat())
}

fn realm(record: &Record, node: &str) -> String {
    let nodes = record.0["nodes"].as_array().unwrap();
    let node = nodes.iter().find(|found| found["id"] == node).unwrap();
    node["realm"].as_str().unwrap().to_owned()
}

#[test]
fn a_gpu_that_is_not_there_is_told_once_and_the_cpu_does_the_same() {
    let desk = Desk::new();
    views(&desk, "cpu", "cpu").exits(0);
    let device = ["--device", "gpu:no GPU is called this", "--out", "other"];
    let mut command = desk.command(&[MAIN, SHORT, &device].concat());
    let output = command.env_remove("GEAR_REQUIRE_GPU").output().unwrap();
    let done = Done::from(output).exits(0);
    assert_eq!(done.stderr.matches("the CPU is used instead").count(), 1, "{done:#?}");
    let (cpu, other) = (desk.record("cpu"), desk.record("other"));
    assert_eq!(other.outputs(), cpu.outputs());
    assert_eq!(other.with_status("ran"), Vec::<&str>::new());
    assert_eq!(realm(&other, "views"), "cpu");
}

#[test]
fn a_required_gpu_that_is_not_there_is_an_error_before_anything_runs() {
    let desk = Desk::new();
    let arguments = [MAIN, &["--device", "gpu:no GPU is called this"]].concat();
    let done = desk.command(&arguments).env("GEAR_REQUIRE_GPU", "1").output().unwrap();
    let done = Done::from(done).exits(2).says("a GPU is required");
    assert!(done.stderr.contains("GEAR_REQUIRE_GPU"), "{done:#?}");
    assert_eq!(desk.listing("out"), Vec::<String>::new());
}

#[test]
fn a_device_that_is_none_is_refused_with_what_there_is() {
    let desk = Desk::new();
    let done = desk.gear(&[MAIN, &["--device", "cuda"]].concat()).exits(2);
    done.says("`auto`, `cpu`, `gpu` or `gpu:NAME`");
}

#[test]
fn what_the_cpu_did_serves_the_gpu_and_never_the_reverse() {
    let desk = Desk::new();
    let done = views(&desk, "gpu", "gpu").exits(0);
    let gpu = desk.record("gpu");
    if realm(&gpu, "restored") == "cpu" {
        assert!(done.stderr.contains("the CPU is used instead"), "{done:#?}");
        println!("skipped: there is no GPU");
        return;
    }
    assert!(realm(&gpu, "restored").starts_with("gpu:"));
    assert_eq!(realm(&gpu, "reconstruct"), "cpu");
    let played = realm(&gpu, "restored").contains("llvmpipe");
    assert_eq!(done.stderr.contains("a GPU that the CPU plays"), played, "{done:#?}");

    views(&desk, "gpu", "again").exits(0);
    assert_eq!(desk.record("again").with_status("ran"), Vec::<&str>::new());
    assert_eq!(desk.record("again").outputs(), gpu.outputs());

    views(&desk, "cpu", "cpu").exits(0);
    let cpu = desk.record("cpu");
    assert!(
        cpu.with_status("ran").contains(&"restored"),
        "{:?}",
        cpu.with_status("ran")
    );

    let fresh = Desk::new();
    views(&fresh, "cpu", "cpu").exits(0);
    views(&fresh, "gpu", "gpu").exits(0);
    assert_eq!(fresh.record("gpu").with_status("ran"), Vec::<&str>::new());
    assert_eq!(fresh.record("gpu").outputs(), fresh.record("cpu").outputs());
}
