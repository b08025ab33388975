//! Processes that share a store, and processes that are killed while they use it.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gear_tests::Desk;

use crate::{SMALL, outputs_in};

const RUN: &[&str] = &["run", "small.yaml", "--input", "painting=sample:vessel", "--quiet"];

fn small() -> Desk {
    let desk = Desk::new();
    desk.file("small.yaml", SMALL);
    desk
}

#[test]
fn three_processes_do_the_same_job_at_once() {
    let desk = small();
    let jobs: Vec<_> = (0..3)
        .map(|i| {
            let mut run = desk.command(&[RUN, &["--out", &format!("out{i}")]].concat());
            run.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
        })
        .collect();
    for job in jobs {
        let done = job.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.success() && !said.contains("warning"), "{said}");
    }
    let first = desk.record("out0");
    for out in ["out1", "out2"] {
        assert_eq!(desk.record(out).outputs(), first.outputs());
        assert!(outputs_in(&desk.path(out)) == outputs_in(&desk.path("out0")), "{out}");
    }
    desk.gear(&["cache", "verify"]).exits(0);
    desk.gear(RUN).exits(0);
    assert_eq!(desk.record("out").with_status("ran"), Vec::<&str>::new());
}

/// 50 times, at a random moment. What a killed run leaves is a store that another run can use.
#[cfg(unix)]
#[test]
fn killed_at_fifty_random_moments() {
    let reference = small();
    let started = Instant::now();
    reference.gear(RUN).exits(0);
    let whole = started.elapsed();

    let desk = small();
    let seed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().subsec_nanos();
    let mut state = u64::from(seed) << 32 | 1;
    let mut random = || {
        // Knuth's MMIX generator; the seed is told when something fails.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 31)
    };
    let mut killed = 0;
    for round in 0..50 {
        // Parameters come again, so that some rounds find what an earlier one left. Every tenth collects.
        let size = format!("painting.size={}", 40 + 4 * (round % 7));
        let arguments = match round % 10 {
            9 => vec!["cache", "gc", "--limit", "60KiB"],
            _ => [RUN, &["--set", &size]].concat(),
        };
        let mut child = desk
            .command(&arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(whole.mul_f64(random()).min(Duration::from_secs(1)));
        // `kill` is SIGKILL.
        child.kill().unwrap();
        killed += usize::from(!child.wait().unwrap().success());
    }
    assert!(
        killed >= 10,
        "only {killed} of 50 were killed before they were done; seed {seed}"
    );

    // A clean run gives what an empty store gives, and leaves a store in which everything is sound.
    desk.gear(&[RUN, &["--out", "clean"]].concat()).exits(0);
    assert_eq!(
        desk.record("clean").outputs(),
        reference.record("out").outputs(),
        "seed {seed}"
    );
    assert!(
        outputs_in(&desk.path("clean")) == outputs_in(&reference.path("out")),
        "seed {seed}"
    );
    let verified = desk.gear(&["cache", "verify"]);
    assert_eq!(verified.code, Some(0), "seed {seed}: {verified:#?}");
}

/// The files below a folder, with their bytes.
fn files(root: &Path) -> BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = std::fs::read(&path).unwrap();
                found.insert(path, bytes);
            }
        }
    }
    found
}

/// What can happen to a file.
type Damage = fn(&[u8]) -> Vec<u8>;

const DAMAGES: [(&str, Damage); 4] = [
    ("truncated", |bytes| bytes[..bytes.len() / 2].to_vec()),
    ("bit flipped", |bytes| {
        let mut bytes = bytes.to_vec();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
        bytes
    }),
    ("zero length", |_| Vec::new()),
    ("foreign", |_| b"#!/bin/sh\nexit 0\n".to_vec()),
];

/// Damages a warm store, runs so that values must be read, and looks at what came of it.
fn survives(name: &str, damage: &dyn Fn(&Desk)) {
    let desk = small();
    desk.gear(RUN).exits(0);
    damage(&desk);
    let again = [RUN, &["--fresh", "pyramid", "--out", "again"]].concat();
    desk.gear(&again).exits(0).says("warning");
    assert_eq!(desk.record("again").outputs(), desk.record("out").outputs(), "{name}");
    assert!(
        outputs_in(&desk.path("again")) == outputs_in(&desk.path("out")),
        "{name}"
    );
    desk.gear(&["cache", "verify", "--repair"]).exits(0);
    desk.gear(&["cache", "verify"]).exits(0);
    // Whatever was lost has come back or comes back now, without a word.
    let third = desk.gear(&[RUN, &["--out", "third"]].concat()).exits(0);
    assert_eq!(third.stderr, "", "{name}");
    assert_eq!(desk.record("third").outputs(), desk.record("out").outputs(), "{name}");
}

#[test]
fn damaged_contents_are_never_believed() {
    for (name, damage) in DAMAGES {
        survives(name, &|desk| {
            for (path, bytes) in files(&desk.path("store/contents")) {
                std::fs::write(path, damage(&bytes)).unwrap();
            }
        });
    }
}

#[test]
fn swapped_contents_are_never_believed() {
    survives("swapped", &|desk| {
        let files = files(&desk.path("store/contents"));
        let next = files.values().skip(1).chain(files.values());
        for (path, bytes) in files.keys().zip(next) {
            std::fs::write(path, bytes).unwrap();
        }
    });
}

#[test]
fn a_damaged_log_is_never_believed() {
    for (name, damage) in DAMAGES {
        survives(name, &|desk| {
            let path = desk.path("store/actions-1.log");
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(path, damage(&bytes)).unwrap();
        });
    }
}

#[test]
fn swapped_logs_are_never_believed() {
    survives("swapped", &|desk| {
        let (actions, origins) = (desk.path("store/actions-1.log"), desk.path("store/origins-1.log"));
        let (a, b) = (std::fs::read(&actions).unwrap(), std::fs::read(&origins).unwrap());
        std::fs::write(actions, b).unwrap();
        std::fs::write(origins, a).unwrap();
    });
}

/// Runs a script in a namespace of its own, where it may mount file systems; `None` where that is not allowed.
#[cfg(target_os = "linux")]
fn with_mounts(desk: &Desk, script: &str, arguments: &[&str]) -> Option<gear_tests::Done> {
    let unshare = |command: &str| {
        let mut shell = std::process::Command::new("unshare");
        shell.args(["-rm", "bash", "-c", command, "bash"]);
        shell.current_dir(desk.path("")).env("GEAR_STORE", desk.path("store"));
        shell
    };
    std::fs::create_dir_all(desk.path("probe")).unwrap();
    let allowed = unshare("mount -t tmpfs tmpfs probe").output();
    std::fs::remove_dir(desk.path("probe")).unwrap();
    if !allowed.is_ok_and(|done| done.status.success()) {
        println!("skipped: mounting is not allowed here");
        return None;
    }
    let gear = desk.command(arguments);
    let done = unshare(&format!("set -e; {script}"))
        .arg(gear.get_program())
        .args(gear.get_args())
        .output();
    Some(done.unwrap().into())
}

#[cfg(target_os = "linux")]
#[test]
fn a_read_only_store_serves_what_it_has_and_costs_no_result() {
    let desk = small();
    desk.gear(RUN).exits(0);
    let before = files(&desk.path("store"));
    let read_only = "mount --bind store store; mount -o remount,ro,bind store; exec \"$@\"";
    for (out, set) in [("warm", "painting.size=64"), ("cold", "painting.size=48")] {
        let arguments = [RUN, &["--out", out, "--set", set]].concat();
        let Some(done) = with_mounts(&desk, read_only, &arguments) else {
            return;
        };
        done.exits(0).says("cannot be written");
    }
    assert_eq!(desk.record("warm").with_status("ran"), Vec::<&str>::new());
    assert_eq!(desk.record("warm").outputs(), desk.record("out").outputs());
    assert_eq!(desk.record("cold").with_status("cached"), Vec::<&str>::new());
    assert!(before == files(&desk.path("store")), "nothing was written");
    let plain = [RUN, &["--out", "plain", "--set", "painting.size=48", "--no-cache"]].concat();
    desk.gear(&plain).exits(0);
    assert_eq!(desk.record("cold").outputs(), desk.record("plain").outputs());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_under_the_store_costs_no_result() {
    let reference = small();
    reference.gear(RUN).exits(0);
    // From a disk on which nothing fits to one on which all but the last content does.
    for size in ["4k", "32k", "64k", "96k"] {
        let desk = small();
        std::fs::create_dir_all(desk.path("store")).unwrap();
        let script = format!("mount -t tmpfs -o size={size} tmpfs store; \"$@\"; exec \"$@\"");
        let Some(done) = with_mounts(&desk, &script, RUN) else {
            return;
        };
        done.exits(0).says("cannot be written").says("No space left");
        assert_eq!(
            desk.record("out").outputs(),
            reference.record("out").outputs(),
            "{size}"
        );
        assert!(
            outputs_in(&desk.path("out")) == outputs_in(&reference.path("out")),
            "{size}"
        );
    }
}
