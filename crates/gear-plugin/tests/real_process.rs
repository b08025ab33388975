//! Plugins whose worker is a real process, which dies, hangs, babbles and lies. Whatever it does costs the node that it was
//! running; everything else finishes, and the next node gets a worker that works.
//!
//! The worker needs Python 3 and nothing else; without it these tests say so and pass.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on stops and says where")]

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use gear_graph::{Event, GraphSource, Number, Registry, Run, RunReport, Store};
use gear_plugin::{Plugin, PluginError};

/// A folder with the worker, whose plugin.yaml ends with `more`; none without Python.
fn folder(more: &str) -> Option<tempfile::TempDir> {
    // The program itself: what stands on the path may be a script that sets variables of its own.
    let asked = Command::new("python3")
        .args(["-c", "import sys; print(sys.executable)"])
        .output();
    let Some(python) = asked.ok().filter(|output| output.status.success() && cfg!(unix)) else {
        eprintln!("skipped: there is no python3 on the path");
        return None;
    };
    let python = String::from_utf8(python.stdout).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let worker = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/worker/worker.py");
    std::fs::copy(worker, folder.path().join("worker.py")).unwrap();
    let manifest = format!(
        "gear-plugin: 1\nname: odd\ncommand: [{}, worker.py]\nlimits: {{output-mb: 1}}\n\
         timeouts: {{start: 60, run: 20, cancel: 1}}\n{more}",
        python.trim()
    );
    std::fs::write(folder.path().join("plugin.yaml"), manifest).unwrap();
    Some(folder)
}

fn change(folder: &Path, from: &str, to: &str) {
    let path = folder.join("plugin.yaml");
    let text = std::fs::read_to_string(&path).unwrap().replace(from, to);
    std::fs::write(path, text).unwrap();
}

struct Bench {
    plugin: Arc<Plugin>,
    registry: Registry,
}

fn bench(folder: &Path) -> Bench {
    let plugin = Plugin::open(folder, None).unwrap();
    let mut registry = Registry::new();
    plugin.register(&mut registry).unwrap();
    Bench { plugin, registry }
}

impl Bench {
    /// Runs nodes of these modes side by side, each with an output of its mode's name.
    fn run(&self, modes: &[&str]) -> (RunReport, Vec<Option<f64>>) {
        self.run_with(modes, |run| run)
    }

    fn run_with(&self, modes: &[&str], with: impl for<'g> FnOnce(Run<'g>) -> Run<'g>) -> (RunReport, Vec<Option<f64>>) {
        let mut text = "gear: 1\ninputs: {n: Number}\nnodes:\n".to_owned();
        for mode in modes {
            text.push_str(&format!(
                "  {mode}: {{node: Odd, in: {{number: n}}, with: {{mode: {mode}}}}}\n"
            ));
        }
        text.push_str("outputs:\n");
        for mode in modes {
            text.push_str(&format!("  {mode}: {mode}.number\n"));
        }
        let graph = GraphSource::new("odd.yaml", text).check(&self.registry).unwrap();
        let run = Run::new(&graph).input_value("n", Number(4.0)).jobs(2).with_values();
        let outcome = with(run).go().unwrap();
        let values = modes
            .iter()
            .map(|mode| Some(outcome.value(mode)?.get::<Number>()?.0))
            .collect();
        (outcome.report, values)
    }

    /// Runs a node of this mode, which must fail, beside one that behaves, which must not; how it failed.
    fn failure(&self, mode: &str) -> String {
        let (report, values) = self.run(&[mode, "well"]);
        assert_eq!(values, [None, Some(5.0)], "{mode}: {:?}", report.failures);
        assert_eq!(report.failures.len(), 1, "{mode}");
        report.failures[0].to_string()
    }
}

#[test]
fn a_worker_stays_for_the_nodes_that_follow() {
    let Some(folder) = folder("") else { return };
    let bench = bench(folder.path());
    let (_, first) = bench.run(&["pid"]);
    let (_, second) = bench.run(&["pid"]);
    assert!(first[0].is_some_and(|pid| pid > 0.0));
    assert_eq!(first, second);
    bench.plugin.rest();
    assert_ne!(bench.run(&["pid"]).1, first, "a rested plugin starts another");
}

#[test]
fn a_plugin_that_nothing_describes_is_started_once() {
    let beside = tempfile::tempdir().unwrap();
    let starts = beside.path().join("starts");
    let set = format!("environment: {{set: {{ODD_STARTS: {}}}}}\n", starts.display());
    let Some(folder) = folder(&set) else { return };
    assert_eq!(bench(folder.path()).run(&["well"]).1, [Some(5.0)]);
    let started = std::fs::read_to_string(starts).unwrap();
    assert_eq!(started.lines().count(), 1, "{started}");
}

#[test]
fn a_worker_that_dies_half_way_costs_its_node_and_nothing_else() {
    let Some(folder) = folder("") else { return };
    let told = bench(folder.path()).failure("die");
    assert!(told.contains("ended while a node ran, by signal 9"), "{told}");
    assert!(told.contains("Segmentation fault, says the driver"), "{told}");
    assert!(
        !told.contains('\u{1b}'),
        "no control characters reach the terminal: {told:?}"
    );
}

#[test]
fn a_worker_that_hangs_is_ended_in_time() {
    let Some(folder) = folder("") else { return };
    change(folder.path(), "run: 20", "run: 4");
    let started = Instant::now();
    let told = bench(folder.path()).failure("hang");
    assert!(told.contains("no answer while a node ran in 4 s"), "{told}");
    assert!(started.elapsed() < Duration::from_secs(60));
}

#[test]
fn what_is_no_message_ends_the_worker() {
    let Some(folder) = folder("") else { return };
    let bench = bench(folder.path());
    let told = bench.failure("garbage");
    assert!(told.contains("`Loading weights... 100%`"), "{told}");
    for mode in ["stranger", "request"] {
        let told = bench.failure(mode);
        assert!(told.contains("does not keep to the protocol"), "{mode}: {told}");
    }
    let told = bench.failure("endless");
    assert!(told.contains("longer line"), "{told}");
}

#[test]
fn a_flood_of_messages_is_held_up_and_ended() {
    let Some(folder) = folder("") else { return };
    change(folder.path(), "run: 20", "run: 4");
    let told = bench(folder.path()).failure("flood");
    assert!(told.contains("no answer while a node ran"), "{told}");
}

#[test]
fn files_that_are_huge_foreign_or_wrong_are_refused_and_the_worker_goes_on() {
    let Some(folder) = folder("") else { return };
    let bench = bench(folder.path());
    let (_, pid) = bench.run(&["pid"]);
    for (mode, expected) in [
        ("huge", "`limits` in plugin.yaml allows 1048576"),
        ("link", "is not a regular file"),
        ("elsewhere", "expected a plain file name"),
        ("absolute", "expected a plain file name"),
        ("nothing", "names no file for it"),
        ("nonsense", "`number.json`"),
        ("nan", "is not a number"),
    ] {
        let told = bench.failure(mode);
        assert!(
            told.contains(expected) && told.contains("output `number`"),
            "{mode}: {told}"
        );
    }
    assert!(bench.failure("fails").contains("not to my taste; give another"));
    assert_eq!(bench.run(&["pid"]).1, pid, "none of this ended it");
}

#[test]
fn a_handshake_that_goes_wrong_is_told() {
    for (mode, expected) in [
        ("exit", "with exit code 3; it said last:\n    no such model"),
        ("garbage", "`Welcome to the worker!`"),
        ("name", "calls itself `other`"),
        ("protocol", "speaks version 2"),
    ] {
        let Some(folder) = folder(&format!("environment: {{set: {{ODD_HANDSHAKE: {mode}}}}}\n")) else {
            return;
        };
        let Err(PluginError::Worker { failure, .. }) = Plugin::open(folder.path(), None) else {
            panic!("{mode}: it was opened");
        };
        assert!(failure.to_string().contains(expected), "{mode}: {failure}");
    }
    let Some(folder) = folder("environment: {set: {ODD_HANDSHAKE: hang}}\n") else {
        return;
    };
    change(folder.path(), "start: 60", "start: 1");
    let told = Plugin::open(folder.path(), None).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("no answer during the handshake in 1 s"), "{told}");
    let Some(folder) = folder_many() else { return };
    let plugin = Plugin::open(folder.path(), None).unwrap();
    let told = plugin.register(&mut Registry::new()).unwrap_err().to_string();
    assert!(told.contains("describes 1000 nodes"), "{told}");
}

fn folder_many() -> Option<tempfile::TempDir> {
    folder("environment: {set: {ODD_HANDSHAKE: many}}\n")
}

#[test]
fn a_program_that_cannot_be_started_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = "gear-plugin: 1\nname: odd\ncommand: [no-such-program-anywhere]\n";
    std::fs::write(folder.path().join("plugin.yaml"), manifest).unwrap();
    let told = Plugin::open(folder.path(), None).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("`no-such-program-anywhere` cannot be started"), "{told}");
}

#[test]
fn no_shell_reads_the_command() {
    let Some(folder) = folder("") else { return };
    change(
        folder.path(),
        ", worker.py]",
        ", worker.py, '; touch pwned', '$(touch pwned)', '`touch pwned`']",
    );
    assert_eq!(bench(folder.path()).run(&["well"]).1, [Some(5.0)]);
    assert!(!folder.path().join("pwned").exists());
}

#[test]
fn an_interrupted_run_stops_the_worker_that_does_not_listen() {
    let Some(folder) = folder("") else { return };
    let bench = bench(folder.path());
    let stop = Arc::new(AtomicBool::new(false));
    let raise = Arc::clone(&stop);
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(700));
        raise.store(true, Ordering::Relaxed);
    });
    let started = Instant::now();
    let (report, values) = bench.run_with(&["hang"], |run| run.cancel(stop));
    assert_eq!(values, [None]);
    assert_eq!(report.status, gear_graph::RunStatus::Interrupted);
    assert!(
        started.elapsed() < Duration::from_secs(19),
        "cancelled in a second, not after the node's time"
    );
    assert_eq!(bench.run(&["well"]).1, [Some(5.0)]);
}

#[test]
fn what_the_worker_started_ends_with_it() {
    let Some(folder) = folder("") else { return };
    let out = folder.path().join("group");
    let set = format!("environment: {{set: {{ODD_OUT: {}}}}}\n", out.display());
    let path = folder.path().join("plugin.yaml");
    let text = std::fs::read_to_string(&path).unwrap() + &set;
    std::fs::write(path, text).unwrap();
    let (_, values) = bench(folder.path()).run(&["child"]);
    assert_eq!(values, [None]);
    let group = std::fs::read_to_string(out).unwrap();
    // Signal 0 asks whether anybody is there.
    let alive = || {
        let status = Command::new("kill").args(["-0", "--", &format!("-{group}")]).output();
        status.is_ok_and(|output| output.status.success())
    };
    let deadline = Instant::now() + Duration::from_secs(10);
    while alive() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(!alive(), "a child of the worker lives on");
}

#[test]
fn progress_and_notes_reach_the_user() {
    let Some(folder) = folder("") else { return };
    let bench = bench(folder.path());
    let seen = Arc::new(Mutex::new(Vec::new()));
    let sink = Arc::clone(&seen);
    let observer = move |event: &Event<'_>| {
        if let Event::Progress { progress, .. } = event {
            sink.lock().unwrap().push(progress.fraction);
        }
    };
    let (report, values) = bench.run_with(&["slow", "note"], |run| run.observer(Arc::new(observer)));
    assert_eq!(values, [Some(5.0), Some(5.0)]);
    assert!(seen.lock().unwrap().len() > 3);
    let told = serde_json::to_string(&report).unwrap();
    assert!(told.contains("a note") && !told.contains("\\u001b"), "{told}");
}

#[test]
fn only_declared_variables_are_passed_on() {
    // Cargo sets this one for tests; the worker must not see it unless it is named.
    assert!(std::env::var_os("CARGO_MANIFEST_DIR").is_some());
    let names = |pass: &str| -> Option<Vec<String>> {
        let folder = folder(&format!(
            "environment: {{pass: [{pass}], set: {{ODD_HANDSHAKE: environment}}}}\n"
        ))?;
        let plugin = Plugin::open(folder.path(), None).unwrap();
        let states = plugin.hello(None).unwrap().states;
        Some(serde_json::from_value(states["environment"].clone()).unwrap())
    };
    let Some(few) = names("") else { return };
    let more = names("CARGO_MANIFEST_DIR, NOT_SET_ANYWHERE").unwrap();
    assert!(
        !few.iter().any(|name| name.starts_with("CARGO") || name == "HOME"),
        "{few:?}"
    );
    assert!(more.contains(&"CARGO_MANIFEST_DIR".to_owned()), "{more:?}");
    // LC_CTYPE is Python's own doing.
    let allowed = [
        "PATH",
        "TMPDIR",
        "TMP",
        "TEMP",
        "GEAR_PLUGIN",
        "ODD_HANDSHAKE",
        "LC_CTYPE",
    ];
    let odd: Vec<_> = few
        .iter()
        .filter(|name| !allowed.contains(&name.as_str()) && !name.starts_with("__"))
        .collect();
    assert!(odd.is_empty(), "{odd:?}");
}

#[test]
fn results_are_kept_under_what_the_plugin_is_and_states() {
    let Some(folder) = folder("") else { return };
    let store = tempfile::tempdir().unwrap();
    let ran = || {
        let store = Arc::new(Store::open(store.path()));
        let (report, values) = bench(folder.path()).run_with(&["well"], |run| run.store(store));
        assert_eq!(values, [Some(5.0)]);
        report.ran().len()
    };
    assert_eq!((ran(), ran()), (1, 0), "the second run finds what the first computed");
    let manifest = folder.path().join("plugin.yaml");
    let plain = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, format!("{plain}environment: {{pass: [ODD_WEIGHTS]}}\n")).unwrap();
    assert_eq!(ran(), 0, "which variables are passed on is no source");
    std::fs::write(
        &manifest,
        format!("{plain}environment: {{set: {{ODD_WEIGHTS: '2'}}}}\n"),
    )
    .unwrap();
    assert_eq!((ran(), ran()), (1, 0), "other weights, other results");
    std::fs::write(&manifest, &plain).unwrap();
    assert_eq!(ran(), 0, "the first ones are still there");
    let worker = folder.path().join("worker.py");
    let text = std::fs::read_to_string(&worker).unwrap();
    std::fs::write(&worker, format!("{text}\n# changed\n")).unwrap();
    assert_eq!(ran(), 1, "a changed source is another plugin");
}

#[test]
fn a_worker_that_states_something_else_than_the_keys_does_not_run() {
    let Some(folder) = folder("environment: {set: {ODD_HANDSHAKE: unstable}}\n") else {
        return;
    };
    let bench = bench(folder.path());
    assert_eq!(bench.run(&["well"]).1, [Some(5.0)]);
    bench.plugin.rest();
    let (report, values) = bench.run(&["well"]);
    assert_eq!(values, [None]);
    assert!(
        report.failures[0]
            .to_string()
            .contains("states other versions or weights")
    );
}

#[test]
fn a_description_in_a_file_needs_no_worker_and_must_be_true() {
    let Some(folder) = folder("nodes: nodes.json\n") else {
        return;
    };
    let told = Plugin::open(folder.path(), None).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("gear plugin describe"), "{told}");
    let described = Plugin::ask(folder.path()).unwrap().nodes().to_vec();
    let path = folder.path().join("nodes.json");
    let write = |nodes: Vec<gear_plugin::NodeDescription>| {
        std::fs::write(&path, serde_json::to_vec(&gear_plugin::NodesFile::new(nodes)).unwrap()).unwrap();
    };
    write(described.clone());
    // Nothing is started: with a program that does not exist the description is still there.
    change(folder.path(), "command: [", "command: [no-such-program, ");
    assert_eq!(bench(folder.path()).plugin.nodes(), described);
    change(folder.path(), "no-such-program, ", "");
    assert_eq!(bench(folder.path()).run(&["well"]).1, [Some(5.0)]);
    let mut untrue = described;
    untrue[0].version = 7;
    write(untrue);
    let (report, _) = bench(folder.path()).run(&["well"]);
    assert!(
        report.failures[0]
            .to_string()
            .contains("describes its nodes differently"),
        "{:?}",
        report.failures
    );
}

#[test]
fn what_a_worker_said_of_its_nodes_is_kept_for_these_sources() {
    let Some(folder) = folder("") else { return };
    let cache = tempfile::tempdir().unwrap();
    let first = Plugin::open(folder.path(), Some(cache.path()))
        .unwrap()
        .nodes()
        .to_vec();
    assert_eq!(std::fs::read_dir(cache.path()).unwrap().count(), 1);
    // A worker that cannot be asked any more: not its sources changed, only what the path leads to.
    let again = Plugin::open(folder.path(), Some(cache.path())).unwrap();
    assert_eq!(again.nodes(), first);
    std::fs::write(folder.path().join("worker.py"), "raise SystemExit(1)").unwrap();
    assert!(
        Plugin::open(folder.path(), Some(cache.path())).is_err(),
        "other sources are asked again"
    );
}

#[test]
fn a_name_that_is_taken_is_told() {
    let Some(folder) = folder("") else { return };
    let mut bench = bench(folder.path());
    let told = bench.plugin.register(&mut bench.registry).unwrap_err().to_string();
    assert!(
        told.contains("a node type `Odd` already, of the plugin `odd`"),
        "{told}"
    );
}

#[test]
fn the_test_of_a_plugin_finds_what_is_wrong() {
    let findings = |folder: &Path, params: serde_json::Value| {
        let mut found = Vec::new();
        let well = gear_plugin::conformance(folder, &Registry::new(), &params, &mut |finding| {
            found.push(finding.clone())
        });
        assert_eq!(well, found.iter().all(|finding| finding.wrong.is_none()));
        found
    };
    let Some(folder) = folder("") else { return };
    let good = findings(folder.path(), serde_json::json!({}));
    assert!(
        good.len() >= 6 && good.iter().all(|finding| finding.wrong.is_none()),
        "{good:#?}"
    );
    let wrong = |folder: &Path, params, what: &str| {
        let found = findings(folder, params);
        let finding = found.iter().find(|finding| finding.what.contains(what)).unwrap();
        finding
            .wrong
            .clone()
            .unwrap_or_else(|| panic!("nothing was found wrong with {what}"))
    };
    let random = wrong(
        folder.path(),
        serde_json::json!({"Odd": {"mode": "pid"}}),
        "another process",
    );
    assert!(random.contains("in another"), "{random}");
    let useless = wrong(
        folder.path(),
        serde_json::json!({"Odd": {"mode": "fails"}}),
        "an answer to some",
    );
    assert!(useless.contains("not to my taste; give another"), "{useless}");
    let Some(folder) = self::folder("environment: {set: {ODD_HANDSHAKE: unstable}}\n") else {
        return;
    };
    let unstable = wrong(folder.path(), serde_json::json!({}), "second worker");
    assert!(unstable.contains("two handshakes differ"), "{unstable}");
}

/// A program of the plugin's own is found from wherever its folder is named.
#[cfg(unix)]
#[test]
fn a_plugin_is_tested_by_a_relative_path_to_its_folder() {
    let Some(folder) = folder("") else { return };
    let bin = folder.path().join(".venv/bin");
    std::fs::create_dir_all(&bin).unwrap();
    let manifest = std::fs::read_to_string(folder.path().join("plugin.yaml")).unwrap();
    let (_, after) = manifest.split_once("command: [").unwrap();
    let (python, _) = after.split_once(", worker.py]").unwrap();
    change(folder.path(), &format!("command: [{python},"), "command: [python,");
    let script = format!("#!/bin/sh\nexec '{python}' \"$@\"\n");
    let program = bin.join("python");
    std::fs::write(&program, script).unwrap();
    std::fs::set_permissions(&program, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let here = std::env::current_dir().unwrap();
    let up: std::path::PathBuf = here.components().skip(1).map(|_| "..").collect();
    let relative = up.join(folder.path().canonicalize().unwrap().strip_prefix("/").unwrap());
    let well = gear_plugin::conformance(&relative, &Registry::new(), &serde_json::json!({}), &mut |finding| {
        assert_eq!(finding.wrong, None, "{}", finding.what);
    });
    assert!(well);
}
