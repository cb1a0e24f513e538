//! The program `dynocar-bench`; everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_bench::cli::main()
}
