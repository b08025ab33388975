//! Plugins as a user meets them: one that `gear new-plugin` wrote, those that come with gear and are not installed, and the
//! Python package that they are written with.
//!
//! What needs Python with numpy looks for it in `GEAR_TEST_PYTHON` (a program), else `python3`; without it these tests say
//! so and pass.

use std::path::{Path, PathBuf};
use std::process::Command;

use gear_tests::{Desk, Done};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// A Python that has numpy.
fn python() -> Option<String> {
    let program = std::env::var("GEAR_TEST_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let numpy = Command::new(&program).args(["-c", "import numpy"]).output();
    if numpy.is_ok_and(|output| output.status.success()) {
        return Some(program);
    }
    eprintln!("skipped: {program} with numpy is not there; GEAR_TEST_PYTHON names another");
    None
}

/// A plugin as `gear new-plugin` writes it, for this Python.
fn new_plugin(desk: &Desk, name: &str, python: &str) {
    let done = desk.gear(&["new-plugin", name]).exits(0);
    assert!(done.stdout.contains("gear plugin check"), "{done:?}");
    let manifest = desk.path(name).join("plugin.yaml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(
        &manifest,
        text.replace("command: [python,", &format!("command: [{python},")),
    )
    .unwrap();
}

const WARM: &str = "gear: 1\ninputs: {painting: {type: Image, with: {size: 48}}}\nnodes:\n  \
                    warm: {node: WarmLight, in: {image: painting}, with: {amount: 0.25}}\n  \
                    edges: {node: EdgeDetect, in: {image: painting}}\noutputs: {warm: warm.image, edges: edges.edges}\n";

fn run(desk: &Desk, more: &[&str]) -> Done {
    let mut arguments = vec!["run", "warm.yaml", "--input", "painting=sample:court-lady"];
    arguments.extend(more);
    desk.gear(&arguments)
}

#[test]
fn a_new_plugin_works_as_it_stands() {
    let Some(python) = python() else { return };
    let desk = Desk::new();
    new_plugin(&desk, "warm-light", &python);
    let own = Command::new(&python)
        .args(["-m", "unittest", "-q"])
        .current_dir(desk.path("warm-light"))
        .output()
        .unwrap();
    assert!(own.status.success(), "{}", String::from_utf8_lossy(&own.stderr));
    let checked = desk.gear(&["plugin", "check", "warm-light"]).exits(0).stdout;
    assert!(checked.contains("ok     WarmLight: extreme inputs"), "{checked}");
    assert!(
        checked.contains("ok     WarmLight: the same bits from another process"),
        "{checked}"
    );

    desk.file("warm.yaml", WARM);
    desk.gear(&["check", "warm.yaml"])
        .exits(2)
        .says("there is no node type `WarmLight`");
    desk.gear(&["check", "warm.yaml", "--plugin", "warm-light"]).exits(0);
    let told = desk
        .gear(&["nodes", "WarmLight", "--plugin", "warm-light"])
        .exits(0)
        .stdout;
    assert!(
        told.contains("plugin warm-light") && told.contains("0 to 1 (share)"),
        "{told}"
    );
    let schema = desk.gear(&["schema", "--plugin", "warm-light"]).exits(0).stdout;
    assert!(schema.contains("WarmLight"));
    desk.gear(&["check", "warm.yaml", "--plugin", "warm-light", "--set", "warm.amount=3"])
        .exits(2)
        .says("must be 0 to 1 (share), found `3`");

    run(&desk, &["--plugin", "warm-light"]).exits(0);
    let record = desk.record("out");
    let ran = record.with_status("ran");
    assert!(ran.contains(&"edges") && ran.contains(&"warm"), "{ran:?}");
    assert!(
        record.0.to_string().contains("plugin:warm-light:"),
        "the realm is in the record"
    );
    run(&desk, &["--plugin", "warm-light"]).exits(0);
    assert!(desk.record("out").with_status("ran").is_empty(), "its results are kept");
    // A changed source is another plugin.
    let worker = desk.path("warm-light/worker.py");
    let text = std::fs::read_to_string(&worker).unwrap();
    std::fs::write(&worker, text.replace("1 + amount", "1 + 2 * amount")).unwrap();
    run(&desk, &["--plugin", "warm-light"]).exits(0);
    assert_eq!(desk.record("out").with_status("ran"), ["warm"]);
}

#[test]
fn only_folders_that_the_user_names_are_started() {
    let Some(python) = python() else { return };
    let desk = Desk::new();
    new_plugin(&desk, "warm-light", &python);
    // A program that leaves a trace when it is started.
    let worker = desk.path("warm-light/worker.py");
    let text = std::fs::read_to_string(&worker).unwrap();
    let trace = desk.path("started");
    std::fs::write(
        &worker,
        format!("open({:?}, 'w').close()\n{text}", trace.display().to_string()),
    )
    .unwrap();
    desk.file("warm.yaml", WARM);
    // Beside the graph, and in the folder where gear runs: not named, not started.
    run(&desk, &[]).exits(2).says("there is no node type `WarmLight`");
    // Keys that look as if they could name one are mistakes.
    desk.file(
        "sly.yaml",
        WARM.replace("gear: 1\n", "gear: 1\nplugins: [warm-light]\n"),
    );
    desk.gear(&["check", "sly.yaml"]).exits(2).says("plugins");
    assert!(!trace.exists());

    let config = desk.path("config/gear");
    std::fs::create_dir_all(&config).unwrap();
    std::fs::write(config.join("plugins.yaml"), "plugins: [../../warm-light]\n").unwrap();
    run(&desk, &["--output", "warm"]).exits(0);
    assert!(trace.exists(), "named in the configuration, started");
    std::fs::write(config.join("plugins.yaml"), "plugins: [gone]\n").unwrap();
    desk.gear(&["check", "@gear"]).exits(0).says("is left out");
    desk.gear(&["check", "@gear", "--plugin", "gone"])
        .exits(2)
        .says("a plugin is a folder with a file plugin.yaml");
}

#[test]
fn graphs_of_plugins_that_are_not_installed_are_checked_and_say_what_to_do() {
    let desk = Desk::new();
    for graph in [
        "@gear-full",
        "@baselines/trellis",
        "@baselines/lgm",
        "@baselines/splatter-image",
    ] {
        assert_eq!(desk.gear(&["check", graph]).exits(0).stderr, "");
    }
    let listed = desk.gear(&["nodes"]).exits(0).stdout;
    assert!(listed.contains("(plugin trellis, not installed)"), "{listed}");
    let input = ["--input", "painting=sample:court-lady", "--set", "painting.size=48"];
    let mut arguments = vec!["run", "@baselines/trellis"];
    arguments.extend(input);
    desk.gear(&arguments)
        .exits(2)
        .says("nothing was computed")
        .says("(Trellis): install it as docs/src/models/trellis.md says")
        .says("--plugin nodes/python/trellis");
    assert!(!desk.path("out/foreground.json").exists());
    arguments.push("--keep-going");
    desk.gear(&arguments)
        .exits(1)
        .says("`Trellis` is a node of the plugin `trellis`")
        .says("--plugin nodes/python/trellis");
    assert!(
        desk.path("out/foreground.json").exists(),
        "what does not depend on it is there"
    );
}

#[test]
fn plugins_that_come_with_gear_describe_themselves_as_gear_has_them() {
    let Some(python) = python() else { return };
    let desk = Desk::new();
    for folder in ["flux_kontext", "gaussian_editor", "lgm", "splatter_image", "trellis"] {
        let source = root().join("nodes/python").join(folder);
        // The worker answers without any of its models.
        let request =
            "{\"jsonrpc\": \"2.0\", \"id\": 1, \"method\": \"initialize\", \"params\": {\"scratch\": \".\"}}\n";
        desk.file("request", request);
        let asked = Command::new(&python)
            .arg("worker.py")
            .current_dir(&source)
            .env("PYTHONPATH", "..")
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("GEAR_PLUGIN", "1")
            .stdin(std::fs::File::open(desk.path("request")).unwrap())
            .output()
            .unwrap();
        let answer: serde_json::Value = serde_json::from_slice(&asked.stdout)
            .unwrap_or_else(|_| panic!("{folder}: {}", String::from_utf8_lossy(&asked.stderr)));
        let kept = gear_tests::json(&source.join("nodes.json"));
        assert_eq!(
            answer["result"]["nodes"], kept["nodes"],
            "{folder}: `gear plugin describe` writes nodes.json"
        );
    }
}

/// Two edits by a FluxKontextPipeline whose networks are as small as their classes allow, and random.
const FLUX: &str = "gear: 1\ninputs: {painting: {type: Image, with: {size: 96}}}\nnodes:\n  \
                    stone: {node: FluxKontext, in: {image: painting}, with: {steps: 2, area: 4096, seed: 3}}\n  \
                    other: {node: FluxKontext, in: {image: painting}, with: {steps: 2, area: 4096, seed: 4}}\n  \
                    edges: {node: EdgeDetect, in: {image: stone.image}}\n\
                    outputs: {stone: stone.image, other: other.image, edges: edges.edges}\n";

#[test]
#[ignore = "needs torch and diffusers, gigabytes: `just flux` installs them and runs this"]
fn the_real_pipeline_class_of_flux_kontext_runs_in_a_graph() {
    let python = std::env::var("GEAR_TEST_DIFFUSERS_PYTHON").expect("the python of an environment with diffusers");
    let folder = root().join("nodes/python/flux_kontext");
    let desk = Desk::new();
    let write = "import sys; from pathlib import Path; from test_real_diffusers import tiny_pipeline; \
                 tiny_pipeline(Path(sys.argv[1]))";
    let written = Command::new(&python)
        .args(["-c", write, &desk.path("weights").display().to_string()])
        .current_dir(&folder)
        .env("PYTHONPATH", "..")
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    desk.file("flux.yaml", FLUX);
    // As in an active environment.
    let bin = Path::new(&python).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let run = |more: &[&str]| -> Done {
        let plugin = folder.display().to_string();
        let mut arguments = vec![
            "run",
            "flux.yaml",
            "--input",
            "painting=sample:court-lady",
            "--plugin",
            &plugin,
        ];
        arguments.extend(more);
        let mut command = desk.command(&arguments);
        command
            .env("PATH", &path)
            .env("FLUX_KONTEXT_WEIGHTS", desk.path("weights"));
        command
            .env("FLUX_KONTEXT_DEVICE", "cpu")
            .env("PYTHONDONTWRITEBYTECODE", "1");
        Done::from(command.output().unwrap()).exits(0)
    };
    run(&["--cache-nondeterministic"]);
    let record = desk.record("out");
    assert!(
        record.0.to_string().contains("plugin:flux-kontext:"),
        "the realm is in the record"
    );
    let bytes = |name: &str| std::fs::read(desk.path("out").join(name)).unwrap();
    assert_ne!(bytes("stone.png"), bytes("other.png"), "another seed, another picture");
    let size = gear_image::io::read_image(&desk.path("out/stone.png"), &Default::default())
        .unwrap()
        .image
        .size();
    assert_eq!(size, (72, 96), "the painting's");
    run(&["--cache-nondeterministic"]);
    assert!(desk.record("out").with_status("ran").is_empty(), "what it made is kept");
}

#[test]
fn the_python_package_keeps_its_promises() {
    let Some(python) = python() else { return };
    let done = Command::new(&python)
        .args(["-m", "unittest", "discover", "-s", "tests", "-t", "."])
        .current_dir(root().join("nodes/python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success() && told.contains("OK"), "{told}");
}
