//! `dynocar-recording` as the tests start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_recording::cli::main()
}
