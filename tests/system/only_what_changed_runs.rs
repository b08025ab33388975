//! Nothing runs twice, and nothing runs that nobody needs.

use std::time::{Duration, Instant};

use gear_image::io::png_bytes;
use gear_image::{Image, SrgbImage};
use gear_tests::Desk;

use crate::MAIN;

#[test]
fn nothing_changed_nothing_runs_and_the_files_are_the_same() {
    let desk = Desk::new();
    desk.gear(MAIN).exits(0);
    let first = desk.record("out");
    assert_eq!(first.with_status("cached"), Vec::<&str>::new());
    let files = desk.listing("out");
    for name in [
        "scene.ply",
        "grounded.png",
        "metrics.json",
        "run.json",
        "report.html",
        "views/yaw+0.png",
    ] {
        assert!(files.contains(&name.to_owned()), "{name} in {files:?}");
    }
    assert_eq!(files.iter().filter(|name| name.starts_with("views/")).count(), 7);

    let again = [MAIN, &["--out", "again"]].concat();
    let started = Instant::now();
    desk.gear(&again).exits(0);
    // The promise for a release build is 0.3 s; this is a debug build on a machine that may be busy.
    assert!(started.elapsed() < Duration::from_secs(5), "{:?}", started.elapsed());
    let second = desk.record("again");
    assert_eq!(second.with_status("ran"), Vec::<&str>::new());
    assert_eq!(second.outputs(), first.outputs());
    assert_eq!(desk.listing("again"), files);
    for name in files
        .iter()
        .filter(|name| !["run.json", "report.html"].contains(&name.as_str()))
    {
        let read = |out: &str| std::fs::read(desk.path(out).join(name)).unwrap();
        assert!(read("out") == read("again"), "{name}");
    }

    // Only the metrics depend on a parameter of theirs.
    let other = [MAIN, &["--set", "metrics.ddi_size=64", "--out", "other"]].concat();
    desk.gear(&other).exits(0);
    assert_eq!(desk.record("other").with_status("ran"), ["metrics"]);

    // What is asked to run again runs again, and gives the same: nothing behind it runs.
    let fresh = [MAIN, &["--fresh", "recompose", "--out", "fresh"]].concat();
    desk.gear(&fresh).exits(0);
    let record = desk.record("fresh");
    assert!(record.with_status("ran").contains(&"recompose"));
    assert!(!record.with_status("ran").contains(&"reconstruct"));
    assert_eq!(record.outputs(), first.outputs());
}

/// A marble ball in the light of a window: colour, and where it is.
fn ball(side: usize) -> (Image, Image) {
    let radius = 0.4 * side as f32;
    let center = (side as f32 - 1.0) / 2.0;
    let normal = |x: usize, y: usize| {
        let (nx, ny) = ((x as f32 - center) / radius, (center - y as f32) / radius);
        let square = 1.0 - nx * nx - ny * ny;
        (square > 0.0).then(|| [nx, ny, square.sqrt()])
    };
    let light = [-0.5, 0.55, 0.67];
    let shaded = SrgbImage::from_fn(side, side, |x, y| {
        let shading = normal(x, y).map(|n| 0.1 + 0.8 * (0..3).map(|k| n[k] * light[k]).sum::<f32>().max(0.0));
        [shading.map_or(0.35, f32::sqrt); 3]
    });
    let inside = SrgbImage::from_fn(side, side, |x, y| [f32::from(u8::from(normal(x, y).is_some())); 3]);
    (Image::opaque(shaded), Image::opaque(inside))
}

#[test]
fn a_picture_with_natural_light_is_not_translated() {
    let desk = Desk::new();
    let (picture, mask) = ball(128);
    desk.file("ball.png", png_bytes(&picture).unwrap());
    desk.file("mask.png", png_bytes(&mask).unwrap());
    let arguments = [
        "run",
        "@gear",
        "--input",
        "painting=ball.png",
        "--input",
        "mask=mask.png",
        "--output",
        "grounded",
    ];
    desk.gear(&arguments).exits(0);
    let record = desk.record("out");
    let left_out = record.with_status("left-out");
    for node in ["translate", "ratio", "pyramid", "gain"] {
        assert!(left_out.contains(&node), "{node} in {left_out:?}");
    }
}

#[test]
fn no_translation_without_grounding() {
    let desk = Desk::new();
    let arguments = [MAIN, &["--set", "recompose.beta=0", "--output", "grounded"]].concat();
    desk.gear(&arguments).exits(0);
    let record = desk.record("out");
    let ran = record.with_status("ran");
    for node in [
        "translate",
        "ratio",
        "pyramid",
        "gain",
        "reconstruct",
        "refine",
        "metrics",
    ] {
        assert!(!ran.contains(&node), "{node} in {ran:?}");
    }
    let reasons = record.0["nodes"].to_string();
    assert!(reasons.contains("beta"), "{reasons}");
}

#[test]
fn without_a_cache_nothing_is_kept() {
    let desk = Desk::new();
    let arguments = [MAIN, &["--output", "grounded", "--no-cache"]].concat();
    desk.gear(&arguments).exits(0);
    assert_eq!(desk.listing("store"), Vec::<String>::new());
    assert!(desk.path("out/grounded.png").exists());
}

#[test]
fn the_plan_tells_what_the_run_then_does() {
    let desk = Desk::new();
    let plan = |more: &[&str]| desk.gear(&[&["plan"], &MAIN[1..], more].concat()).exits(0).stdout;
    let before = plan(&["--output", "grounded"]);
    assert!(
        before
            .lines()
            .any(|line| line.starts_with("recompose") && line.contains("runs")),
        "{before}"
    );
    assert!(
        before
            .lines()
            .any(|line| line.starts_with("refine") && line.contains("left out")),
        "{before}"
    );
    assert_eq!(desk.listing("out"), Vec::<String>::new());
    desk.gear(&[MAIN, &["--output", "grounded"]].concat()).exits(0);
    let after = plan(&["--output", "grounded"]);
    assert!(
        after
            .lines()
            .any(|line| line.starts_with("recompose") && line.contains("stored")),
        "{after}"
    );
}
