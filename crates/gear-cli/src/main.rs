//! The binary `gear`.

use std::process::ExitCode;

fn main() -> ExitCode {
    gear_cli::main_with(&gear_cli::registry())
}
