//! The program `dynocar-live`, built where the end-to-end tests can find it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_live::cli::main()
}
