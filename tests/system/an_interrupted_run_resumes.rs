//! Ctrl-C during the refinement: exit 130, and the next run goes on from what is stored.

#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use gear_tests::{Desk, Done};

use crate::MAIN;

#[test]
fn in_the_middle_of_refine() {
    let desk = Desk::new();
    // So many iterations that it cannot be done before the signal arrives.
    let long = [
        MAIN,
        &["--set", "refine.iterations=100000", "--set", "refine.tolerance=0"],
    ]
    .concat();
    let mut run = desk.command(&long);
    run.env("GEAR_LOG", "info").stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = run.spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap())
        .lines()
        .map_while(Result::ok);
    let started = lines.by_ref().any(|line| line.contains("Refine"));
    assert!(started, "refine did not start");
    // Let it come to its first iterations.
    std::thread::sleep(Duration::from_millis(500));
    let pressed = Instant::now();
    assert!(
        Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
    let rest: Vec<String> = lines.collect();
    let code = child.wait().unwrap().code();
    let done = Done {
        code,
        stdout: String::new(),
        stderr: rest.join("\n"),
    };
    done.exits(130).says("interrupted");
    assert!(pressed.elapsed() < Duration::from_secs(10), "{:?}", pressed.elapsed());
    assert_eq!(desk.listing("out"), Vec::<String>::new());

    desk.gear(MAIN).exits(0);
    let record = desk.record("out");
    for node in ["reconstruct", "edit"] {
        assert!(
            record.with_status("cached").contains(&node),
            "{node} was kept: {:?}",
            record.with_status("ran")
        );
    }
    assert!(record.with_status("ran").contains(&"refine"));
}
