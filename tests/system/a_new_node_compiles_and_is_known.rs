//! `gear new-node` on a copy of the repository: the crate compiles, its tests pass, the binary lists the node, the
//! reference is current and the format is rustfmt's. Outside of it: the crate with its own binary compiles and its tests
//! pass.
//!
//! The test builds the workspace once more, without optimisation, in a folder of its own beside the other results of the
//! build; a second run finds most of it there. It is run by `.ci/run`, or by
//! `cargo test -p gear-tests --test system -- --ignored a_new_node`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// What of the repository is copied; everything else is made by a build or not needed for one.
const COPIED: &[&str] = &[
    "Cargo.toml",
    "Cargo.lock",
    "clippy.toml",
    "rustfmt.toml",
    "crates",
    "nodes",
    "examples",
    "tests",
    "graphs",
    "docs",
    "README.md",
];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Where the copy is and what it is built to. Always the same place: cargo knows crates by their paths.
fn workshop() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("new-node")
}

/// Makes `to` like `from`. What is alike already keeps its time, so that cargo does not build it again.
fn mirror(from: &Path, to: &Path) {
    if from.is_dir() {
        std::fs::create_dir_all(to).unwrap();
        let names = |folder: &Path| {
            let entries = std::fs::read_dir(folder).unwrap();
            entries.map(|entry| entry.unwrap().file_name()).collect::<Vec<_>>()
        };
        let kept = names(from);
        for gone in names(to).into_iter().filter(|name| !kept.contains(name)) {
            let path = to.join(gone);
            if path.is_dir() {
                std::fs::remove_dir_all(path).unwrap();
            } else {
                std::fs::remove_file(path).unwrap();
            }
        }
        for name in kept.iter().filter(|name| *name != "target") {
            mirror(&from.join(name), &to.join(name));
        }
    } else if std::fs::read(from).ok() != std::fs::read(to).ok() {
        std::fs::copy(from, to).unwrap();
    }
}

/// `cargo` in a folder, unoptimised, without the network, and whatever this test was started with.
fn cargo(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO"));
    command.current_dir(folder).arg(arguments[0]);
    if arguments[0] != "fmt" {
        command.args([
            "--offline",
            "--quiet",
            "--config",
            "profile.dev.package.\"*\".opt-level=0",
        ]);
    }
    // What follows `--` is not cargo's.
    command.args(&arguments[1..]);
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CARGO_PKG") || name.starts_with("CARGO_BIN"))
    {
        command.env_remove(name);
    }
    command
        .env("CARGO_TARGET_DIR", workshop().join("target"))
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "0")
        .env("CARGO_PROFILE_DEV_DEBUG", "false")
        .env("CARGO_INCREMENTAL", "0")
        .env_remove("RUSTFLAGS");
    command.output().unwrap()
}

#[track_caller]
fn succeeds(done: Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(done.status.success(), "{}\n{}", text(&done.stdout), text(&done.stderr));
    text(&done.stdout) + &text(&done.stderr)
}

fn gear(folder: &Path, arguments: &[&str]) -> Output {
    let binary = gear_tests::binary();
    Command::new(binary)
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
#[ignore = "builds the workspace once more, in a minute or two; .ci/run runs it"]
fn a_new_node_compiles_passes_its_tests_and_is_listed() {
    let copy = workshop().join("copy");
    std::fs::create_dir_all(&copy).unwrap();
    for name in COPIED {
        mirror(&repository().join(name), &copy.join(name));
    }
    // As it is written without any port, from one type to another that nothing gives yet, and from many to many.
    succeeds(gear(&copy, &["new-node", "Craquelure"]));
    succeeds(gear(
        &copy,
        &[
            "new-node",
            "Guess3D",
            "--input",
            "image:Image",
            "--output",
            "scene:Scene",
        ],
    ));
    let many = [
        "new-node",
        "Several",
        "--input",
        "x:Number",
        "--input",
        "report:Report",
        "--input",
        "field:Field",
        "--input",
        "mask:Mask",
        "--input",
        "scene:Scene",
        "--input",
        "views:Views",
        "--output",
        "x:Number",
        "--output",
        "report:Report",
        "--output",
        "field:Field",
        "--output",
        "mask:Mask",
        "--output",
        "scene:Scene",
        "--output",
        "views:Views",
    ];
    succeeds(gear(&copy.join("nodes"), &many));
    succeeds(cargo(&copy, &["fmt", "--all", "--check"]));

    succeeds(cargo(&copy, &["build", "-p", "gear-cli"]));
    let built = workshop()
        .join("target/debug")
        .join(format!("gear{}", std::env::consts::EXE_SUFFIX));
    let says = |arguments: &[&str]| {
        succeeds(
            Command::new(&built)
                .current_dir(&copy)
                .args(arguments)
                .output()
                .unwrap(),
        )
    };
    let list = says(&["nodes"]);
    for name in ["Craquelure", "Guess3D", "Several"] {
        assert!(list.contains(name), "{list}");
    }
    let reference = std::fs::read_to_string(copy.join("docs/src/reference.md")).unwrap();
    assert!(
        says(&["nodes", "--markdown"]) == reference,
        "the reference is not current"
    );

    let crates = ["-p", "node-craquelure", "-p", "node-guess3-d", "-p", "node-several"];
    let tests = succeeds(cargo(&copy, &[&["test"], &crates[..]].concat()));
    assert_eq!(tests.matches("test result: ok.").count(), 6, "{tests}");

    let beside = workshop().join("beside");
    let _ = std::fs::remove_dir_all(&beside);
    std::fs::create_dir_all(&beside).unwrap();
    let gear_folder = copy.to_str().unwrap();
    succeeds(gear(&beside, &["new-node", "OilGlaze", "--gear", gear_folder]));
    let own = beside.join("oil-glaze");
    succeeds(cargo(&own, &["test"]));
    succeeds(cargo(&own, &["run", "--", "check", "graph.yaml"]));
}
