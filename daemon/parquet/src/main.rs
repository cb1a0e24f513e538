//! The program behind `dynocar convert` where Parquet is read or written.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_parquet::cli::main()
}
