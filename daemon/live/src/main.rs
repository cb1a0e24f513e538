//! The program behind `dynocar live`.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_live::cli::main()
}
