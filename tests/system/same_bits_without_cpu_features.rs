//! The same keys and the same bits on a CPU that can do less.

use std::collections::BTreeMap;

use gear_tests::{Desk, Record};

use crate::MAIN;

/// Every key and digest of a run, by node and port.
fn keys(record: &Record) -> BTreeMap<String, (String, String)> {
    let mut found = BTreeMap::new();
    for node in record.0["nodes"].as_array().unwrap() {
        for port in node["outputs"].as_array().unwrap() {
            let name = format!("{}.{}", node["id"].as_str().unwrap(), port["port"].as_str().unwrap());
            found.insert(name, (port["key"].to_string(), port["digest"].to_string()));
        }
    }
    found
}

/// glibc chooses other routines for `memcpy` and mathematics then, and our own code its baseline (`GEAR_SIMD`). What
/// the standard library's mathematics gives would change; nothing that is stored may depend on it.
#[test]
fn the_main_job_with_features_forced_down() {
    let desk = Desk::new();
    let run = |store: &str, environment: &[(&str, &str)]| {
        let store = desk.path(store).display().to_string();
        let mut run = desk.command(&[MAIN, &["--quiet", "--store", &store, "--out", "out"]].concat());
        let done = run.envs(environment.iter().copied()).output().unwrap();
        gear_tests::Done::from(done).exits(0);
        keys(&desk.record("out"))
    };
    let best = run("best", &[]);
    assert!(best.len() >= 20, "{}", best.len());
    let least = run(
        "least",
        &[
            ("GEAR_SIMD", "baseline"),
            (
                "GLIBC_TUNABLES",
                "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX,-AVX512F,-AVX512VL,-AVX512DQ,-AVX512BW,-SSE4_1,-SSE4_2,-ERMS",
            ),
        ],
    );
    assert_eq!(best, least);
}
