//! `dynocar-live` as the tests start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_live::cli::main()
}
