//! The program `dynocar-watch`; everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_watch::cli::main()
}
