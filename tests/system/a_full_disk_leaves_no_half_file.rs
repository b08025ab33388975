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
