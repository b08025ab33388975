//! `gear cache` and `gear why`, as a user types them.

use gear_tests::{Desk, json};

use crate::SMALL;

const RUN: &[&str] = &["run", "small.yaml", "--input", "painting=sample:vessel", "--quiet"];

fn small() -> Desk {
    let desk = Desk::new();
    desk.file("small.yaml", SMALL);
    desk
}

/// A warm store travels to another machine: nothing runs there.
#[test]
fn an_exported_store_makes_another_machine_s_run_warm() {
    let desk = small();
    desk.gear(RUN).exits(0);
    let first = desk.record("out");
    for (name, what) in [
        ("all.tar", &[][..]),
        (
            "run.tar",
            &["--graph", "small.yaml", "--input", "painting=sample:vessel"],
        ),
    ] {
        desk.gear(&[&["cache", "export", name], what].concat()).exits(0);
        let other = small();
        let archive = desk.path(name).display().to_string();
        other.gear(&["cache", "import", &archive]).exits(0);
        other.gear(RUN).exits(0);
        let record = other.record("out");
        assert_eq!(record.with_status("ran"), Vec::<&str>::new(), "{name}");
        assert_eq!(record.outputs(), first.outputs());
        assert_eq!(desk.listing("out"), other.listing("out"));
        other.gear(&["cache", "verify"]).exits(0);
    }
}

#[test]
fn an_archive_of_one_run_holds_nothing_of_another() {
    let desk = small();
    desk.gear(RUN).exits(0);
    let other = [RUN, &["--set", "ratio.radius=0.2"]].concat();
    desk.gear(&other).exits(0);
    desk.gear(&["cache", "export", "all.tar"]).exits(0);
    let graph = ["--graph", "small.yaml", "--input", "painting=sample:vessel"];
    desk.gear(&[&["cache", "export", "run.tar"], &graph[..]].concat())
        .exits(0);
    let size = |name: &str| std::fs::metadata(desk.path(name)).unwrap().len();
    assert!(size("run.tar") < size("all.tar"));
    // What is not there yet is told.
    let missing = [
        &["cache", "export", "run.tar"],
        &graph[..],
        &["--set", "ratio.radius=0.3"],
    ]
    .concat();
    desk.gear(&missing).exits(0).says("are not in the store");
}

#[test]
fn a_file_that_is_no_archive_is_refused() {
    let desk = small();
    desk.file("holiday.jpg", "not a picture either");
    desk.gear(&["cache", "import", "holiday.jpg"])
        .exits(2)
        .says("no archive of a store");
    desk.gear(&["cache", "import", "none.tar"]).exits(2).says("none.tar");
    desk.gear(RUN).exits(0);
    desk.gear(&["cache", "export", "all.tar"]).exits(0);
    let bytes = std::fs::read(desk.path("all.tar")).unwrap();
    desk.file("cut.tar", &bytes[..bytes.len() / 2]);
    let other = small();
    let cut = desk.path("cut.tar").display().to_string();
    other
        .gear(&["cache", "import", &cut])
        .exits(2)
        .says("damaged")
        .says("nothing was imported");
    desk.gear(&["cache", "export", "no/such/folder/all.tar"]).exits(2);
}

#[test]
fn an_export_replaces_nothing_but_an_archive() {
    let desk = small();
    desk.gear(RUN).exits(0);
    desk.file("mine.yaml", "gear: 1");
    for taken in ["mine.yaml", "-", "out", "/dev/null"] {
        desk.gear(&["cache", "export", taken]).exits(2).says("name a");
    }
    assert_eq!(std::fs::read_to_string(desk.path("mine.yaml")).unwrap(), "gear: 1");
    desk.gear(&["cache", "export", "all.tar"]).exits(0);
    desk.gear(&["cache", "export", "all.tar"]).exits(0);
}

#[test]
fn an_export_that_finds_nothing_leaves_the_archive_that_is_there() {
    let desk = small();
    desk.gear(RUN).exits(0);
    desk.gear(&["cache", "export", "all.tar"]).exits(0);
    let before = std::fs::read(desk.path("all.tar")).unwrap();
    let other = [
        "cache",
        "export",
        "all.tar",
        "--graph",
        "small.yaml",
        "--input",
        "painting=sample:court-lady",
    ];
    desk.gear(&other)
        .exits(2)
        .says("holds nothing of small.yaml")
        .says("--input");
    desk.gear(&["cache", "clear"]).exits(0);
    desk.gear(&["cache", "export", "all.tar"]).exits(2).says("is empty");
    assert_eq!(std::fs::read(desk.path("all.tar")).unwrap(), before);
}

#[test]
fn a_folder_that_gear_did_not_make_is_not_touched() {
    let desk = small();
    desk.file("mine.txt", "mine");
    let here = desk.path("").display().to_string();
    for command in [&["clear"][..], &["gc"], &["verify"], &["stat"], &["export", "all.tar"]] {
        let arguments = [&["cache"], command, &["--store", &here]].concat();
        desk.gear(&arguments).exits(2).says("is no store");
    }
    assert_eq!(desk.listing(""), ["mine.txt", "small.yaml"]);
    // Nor is a store made where a folder has contents of its own.
    std::fs::create_dir_all(desk.path("contents")).unwrap();
    let run = [RUN, &["--store", &here]].concat();
    desk.gear(&run)
        .exits(2)
        .says("is no store and is not empty")
        .says("it holds");
    std::fs::remove_dir(desk.path("contents")).unwrap();
    desk.gear(&run).exits(2);
    let import = ["cache", "import", "mine.txt", "--store", &here];
    desk.gear(&import).exits(2);
    assert_eq!(desk.listing(""), ["mine.txt", "small.yaml"]);
}

#[test]
fn stat_counts_gc_shrinks_and_clear_empties() {
    let desk = small();
    desk.gear(RUN).exits(0);
    let stat = || {
        let text = desk.gear(&["cache", "stat", "--format", "json"]).exits(0).stdout;
        serde_json::from_str::<serde_json::Value>(&text).unwrap()
    };
    let full = stat();
    assert!(full["actions"].as_u64().unwrap() >= 5, "{full}");
    assert!(full["types"]["Image"]["actions"].as_u64().unwrap() >= 2, "{full}");
    assert!(full["content_bytes"].as_u64().unwrap() > 10_000, "{full}");
    let text = desk.gear(&["cache", "stat"]).exits(0).stdout;
    assert!(text.contains("8.0 GiB") && text.contains("Image"), "{text}");

    desk.gear(&["cache", "gc", "--limit", "30KiB"]).exits(0);
    assert!(stat()["content_bytes"].as_u64().unwrap() <= 30 * 1024);
    desk.gear(&["cache", "gc", "--limit", "30 parsecs"])
        .exits(2)
        .says("500MiB");
    // Digests stay known, and lost values come back with the same bits.
    let outputs = desk.record("out");
    desk.gear(&[RUN, &["--out", "again"]].concat()).exits(0);
    assert_eq!(desk.record("again").outputs(), outputs.outputs());

    desk.gear(&["cache", "clear"]).exits(0);
    let empty = stat();
    assert_eq!(
        (&empty["actions"], &empty["contents"]),
        (&0.into(), &0.into()),
        "{empty}"
    );
    desk.gear(&[RUN, &["--out", "third"]].concat()).exits(0);
    assert_eq!(desk.record("third").outputs(), outputs.outputs());
}

#[test]
fn verify_finds_what_is_damaged_and_repairs_it() {
    let desk = small();
    desk.gear(RUN).exits(0);
    desk.gear(&["cache", "verify"]).exits(0);
    let contents = desk.listing("store/contents");
    let victim = desk
        .path("store/contents")
        .join(contents.iter().find(|name| name.ends_with("exr")).unwrap());
    let mut bytes = std::fs::read(&victim).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(&victim, bytes).unwrap();
    let found = desk.gear(&["cache", "verify"]).exits(1);
    assert!(found.stdout.contains("checksum"), "{found:?}");
    desk.gear(&["cache", "verify", "--repair"]).exits(0);
    desk.gear(&["cache", "verify"]).exits(0);
    desk.gear(&[RUN, &["--out", "again"]].concat()).exits(0);
    assert_eq!(desk.record("again").outputs(), desk.record("out").outputs());
}

#[test]
fn why_tells_what_changed_and_where_a_value_came_from() {
    let desk = small();
    desk.gear(RUN).exits(0);
    let why = |more: &[&str]| {
        let run = ["why", "small.yaml", "--input", "painting=sample:vessel"];
        desk.gear(&[&run, more].concat()).exits(0).stdout
    };
    let id = json(&desk.path("out/run.json"))["id"].as_str().unwrap().to_owned();
    let stored = why(&["ratio"]);
    assert!(stored.contains("is stored") && stored.contains(&id), "{stored}");
    let changed = why(&["ratio", "--set", "ratio.radius=0.2"]);
    assert!(changed.contains("parameter radius: 0.03 -> 0.2"), "{changed}");
    let behind = why(&["pyramid.ratio", "--set", "ratio.radius=0.2"]);
    assert!(
        behind.contains("it begins at `ratio`: parameter radius: 0.03 -> 0.2"),
        "{behind}"
    );
    let painting = desk.gear(&["why", "small.yaml", "--input", "painting=sample:court-lady", "painting"]);
    assert!(painting.exits(0).stdout.contains("input file (sample:court-lady"));
    let run = ["why", "small.yaml", "--input", "painting=sample:vessel", "rato"];
    desk.gear(&run).exits(2).says("did you mean `ratio`?");
    let read: serde_json::Value = serde_json::from_str(&why(&["ratio", "--format", "json"])).unwrap();
    assert_eq!(read[0]["computed"]["run"], id.as_str());
}

/// After values were lost, all that tells of a run tells the same: what is computed again is no hit.
#[test]
fn what_is_computed_again_is_said_to_run() {
    let desk = small();
    desk.gear(RUN).exits(0);
    std::fs::remove_dir_all(desk.path("store/contents")).unwrap();
    let plan = desk
        .gear(&["plan", "small.yaml", "--input", "painting=sample:vessel"])
        .exits(0);
    let planned = |node: &str| {
        plan.stdout
            .lines()
            .find(|line| line.starts_with(node))
            .unwrap()
            .to_owned()
    };
    assert!(planned("enhance").contains("runs"), "{}", plan.stdout);
    let again = desk.gear(&RUN[..4]).exits(0);
    let record = desk.record("out");
    assert!(
        record.with_status("ran").contains(&"enhance"),
        "{:?}",
        record.with_status("cached")
    );
    assert!(!again.stderr.contains(": 0 ran"), "{}", again.stderr);
    // Files that are stored need no values: nothing runs, and nothing says so.
    std::fs::remove_dir_all(desk.path("out")).unwrap();
    let third = desk.gear(&RUN[..4]).exits(0);
    assert!(third.stderr.contains(": 0 ran"), "{}", third.stderr);
    assert_eq!(desk.record("out").with_status("ran"), Vec::<&str>::new());
}

#[test]
fn an_export_tells_what_is_not_in_it() {
    let desk = small();
    desk.gear(RUN).exits(0);
    let export = [
        "cache",
        "export",
        "run.tar",
        "--graph",
        "small.yaml",
        "--input",
        "painting=sample:vessel",
    ];
    let whole = desk.gear(&export).exits(0);
    assert_eq!(whole.stderr, "");
    std::fs::remove_dir_all(desk.path("store/contents")).unwrap();
    desk.gear(&export)
        .exits(0)
        .says("are not in the store")
        .says("known by their digests only")
        .says("gear run");
    desk.gear(RUN).exits(0);
    let mended = desk.gear(&export).exits(0);
    assert!(!mended.stderr.contains("not in the store"), "{}", mended.stderr);
}

#[test]
fn who_only_asks_makes_no_store() {
    let desk = small();
    desk.file("holiday.jpg", "not a picture either");
    let run = ["small.yaml", "--input", "painting=sample:vessel"];
    desk.gear(&[&["plan"], &run[..]].concat()).exits(0);
    desk.gear(&[&["why"], &run[..], &["ratio"]].concat()).exits(0);
    desk.gear(&["check", "small.yaml"]).exits(0);
    desk.gear(&["cache", "import", "holiday.jpg"]).exits(2);
    desk.gear(&["cache", "export", "all.tar"]).exits(2);
    assert_eq!(desk.listing(""), ["holiday.jpg", "small.yaml"]);
    assert!(!desk.path("store").exists());
    // Nor is anything written into one.
    desk.gear(RUN).exits(0);
    let stamp = |name: &String| {
        std::fs::metadata(desk.path("store").join(name))
            .unwrap()
            .modified()
            .unwrap()
    };
    let files = || -> Vec<_> {
        desk.listing("store")
            .iter()
            .map(|name| (name.clone(), stamp(name)))
            .collect()
    };
    let before = files();
    desk.gear(&[&["plan"], &run[..], &["--set", "ratio.radius=0.2"]].concat())
        .exits(0);
    desk.gear(&[&["why"], &run[..], &["pyramid"]].concat()).exits(0);
    desk.gear(&["cache", "stat"]).exits(0);
    assert_eq!(files(), before);
}

/// Another user of the machine reads the store, if the folder lets him.
#[cfg(unix)]
#[test]
fn a_store_is_as_readable_as_any_file() {
    use std::os::unix::fs::PermissionsExt;
    let desk = small();
    let gear = desk.command(RUN);
    let mut shell = std::process::Command::new("sh");
    shell
        .args(["-c", "umask 022; exec \"$@\"", "sh"])
        .arg(gear.get_program())
        .args(gear.get_args());
    shell.current_dir(desk.path("")).env("GEAR_STORE", desk.path("store"));
    gear_tests::Done::from(shell.output().unwrap()).exits(0);
    for name in desk.listing("store") {
        let mode = std::fs::metadata(desk.path("store").join(&name))
            .unwrap()
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o644, "{name}");
    }
}
