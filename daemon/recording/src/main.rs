//! The program behind `dynocar record`, `recover`, `convert` and `replay --verify`.

use std::process::ExitCode;

fn main() -> ExitCode {
    dynocar_recording::cli::main()
}
