//! The program `dynocar-workshop`; everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_workshop::cli::main()
}
