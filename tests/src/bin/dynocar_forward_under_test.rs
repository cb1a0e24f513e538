//! `dynocar-forward` as the tests start it.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_forward::cli::main()
}
