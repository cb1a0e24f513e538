//! The program `dynocar`; everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar::cli::main()
}
