//! The program `dynocar-forward`; everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_forward::cli::main()
}
