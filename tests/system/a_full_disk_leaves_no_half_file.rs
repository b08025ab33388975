//! When a result cannot be written completely: exit 1, a message that names the file, and no half file under its name.

use gear_tests::{Desk, Done};

use crate::MAIN;

/// Runs `gear` where no file can grow beyond so many KiB, which is what a full disk looks like to a program.
#[cfg(unix)]
pub fn limited(desk: &Desk, kibibytes: u32, arguments: &[&str]) -> Done {
    let gear = desk.command(arguments);
    // The shell's own limit; the signal that comes with it is ignored, so that the write fails instead.
    let script = format!("trap '' XFSZ; ulimit -f {kibibytes}; exec \"$@\"");
    let mut shell = std::process::Command::new("bash");
    shell
        .args(["-c", &script, "bash"])
        .arg(gear.get_program())
        .args(gear.get_args());
    shell.current_dir(desk.path("")).env("GEAR_STORE", desk.path("store"));
    shell.output().unwrap().into()
}

#[cfg(unix)]
#[test]
fn a_scene_that_does_not_fit() {
    let desk = Desk::new();
    let arguments = [MAIN, &["--output", "scene", "--no-cache"]].concat();
    limited(&desk, 20, &arguments)
        .exits(1)
        .says("scene.ply")
        .says("cannot be written");
    assert_eq!(desk.listing("out"), Vec::<String>::new());
}

/// One output is too large, another is not: what fits is written, and the record tells what is missing.
#[cfg(unix)]
#[test]
fn an_output_that_does_not_fit_costs_no_other() {
    let desk = Desk::new();
    let graph = "\
gear: 1
inputs:
  painting: {type: Image, with: {size: 256}}
nodes:
  ratio: {node: LogRatio, in: {image: painting}}
  enhance: {node: Enhance, in: {image: painting}}
outputs:
  ratio: ratio.ratio
  enhanced: enhance.image
";
    desk.file("graph.yaml", graph);
    let run = ["run", "graph.yaml", "--input", "painting=sample:vessel", "--no-cache"];
    desk.gear(&run).exits(0);
    let size = |name: &str| std::fs::metadata(desk.path("out").join(name)).unwrap().len();
    let [ratio, enhanced, page] = ["ratio.exr", "enhanced.png", "report.html"].map(size);
    let limit = enhanced.max(page).div_ceil(1024) as u32;
    assert!(
        u64::from(limit) * 1024 < ratio,
        "ratio {ratio}, enhanced {enhanced}, page {page}"
    );
    let done = limited(&desk, limit, &[&run[..], &["--out", "small"]].concat())
        .exits(1)
        .says("ratio.exr")
        .says("cannot be written");
    assert!(
        done.stdout.contains("enhanced.png") && !done.stdout.contains("ratio.exr"),
        "{done:?}"
    );
    let record = gear_tests::json(&desk.path("small/run.json"));
    assert_eq!(record["unwritten"][0]["output"], "ratio", "{}", record["unwritten"]);
    let mut files = desk.listing("small");
    assert!(!files.iter().any(|name| name == "ratio.exr"), "{files:?}");
    files.retain(|name| name != "ratio.png");
    let recorded: Vec<_> = record["files"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|name| name.as_str())
        .collect();
    assert!(
        files.iter().all(|name| recorded.contains(&name.as_str())),
        "{files:?} {recorded:?}"
    );
    // With room, the next run completes the folder.
    desk.gear(&[&run[..], &["--out", "small"]].concat()).exits(0);
    assert_eq!(desk.listing("small"), desk.listing("out"));
}

/// On a disk without room for anything, each result is told of, and what was there before is there still.
#[cfg(unix)]
#[test]
fn where_nothing_fits_nothing_changes() {
    let desk = Desk::new();
    desk.file("graph.yaml", crate::SMALL);
    let run = ["run", "graph.yaml", "--input", "painting=sample:vessel"];
    desk.gear(&run).exits(0);
    let before = crate::outputs_in(&desk.path("out"));
    let record = std::fs::read(desk.path("out/run.json")).unwrap();
    let other = [&run[..], &["--set", "painting.size=96"]].concat();
    limited(&desk, 1, &other)
        .exits(1)
        .says("edges.exr: cannot be written")
        .says("ratio.exr: cannot be written")
        .says("enhanced.png: cannot be written");
    assert!(crate::outputs_in(&desk.path("out")) == before);
    assert_eq!(std::fs::read(desk.path("out/run.json")).unwrap(), record);
}
