//! `dynocar-watch` as the tests start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_watch::cli::main()
}
