//! A test that runs the binary makes `cargo test` build it; the system tests in `tests/` rely on that.

use std::process::Command;

#[test]
fn every_command_explains_itself() {
    for command in ["run", "check", "plan", "nodes", "new-node", "graph", "graphs", "sample"] {
        let output = Command::new(env!("CARGO_BIN_EXE_gear"))
            .args([command, "--help"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{command}");
        assert!(
            String::from_utf8_lossy(&output.stdout).contains("Usage: gear"),
            "{command}"
        );
    }
}
