//! `dynocar completions`: what a shell offers after a word that was begun.

use clap::{Args, Command};
use clap_complete::Shell;

use dynocar::cli::Failure;
use dynocar::output::print;

/// Print the completions for a shell.
#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell
    shell: Shell,
}

/// Prints a shell's completions of these commands.
///
/// # Errors
///
/// When standard output cannot be written.
pub fn execute(arguments: &CompletionsArguments, mut commands: Command) -> Result<(), Failure> {
    let name = commands.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut commands, name, &mut script);
    Ok(print(&String::from_utf8_lossy(&script))?)
}
