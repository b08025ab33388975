//! `gear` with the nodes of this crate.

use std::process::ExitCode;

fn main() -> ExitCode {
    let mut registry = gear_cli::registry();
    own_binary::register(&mut registry);
    gear_cli::main_with(&registry)
}
