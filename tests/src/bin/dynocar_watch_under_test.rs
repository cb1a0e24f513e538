//! The program `dynocar-watch`, built where the end-to-end tests can find it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_watch::cli::main()
}
