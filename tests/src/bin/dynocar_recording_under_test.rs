//! The program `dynocar-recording`, built where the end-to-end tests can find it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_recording::cli::main()
}
