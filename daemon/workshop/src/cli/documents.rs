//! Documents of the command line: `dynocar completions` for a shell, `dynocar man` for the manual.

use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use dynocar::cli::Failure;
use dynocar::output::{print, report_line, require_folder, write_in_folder};

/// Write the manual pages, one for every command.
#[derive(Debug, Args)]
pub struct ManArguments {
    /// Write the pages into this folder, which is made where there is none
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Writes the manual pages of these commands.
///
/// # Errors
///
/// When a page cannot be written.
pub fn write_manual(arguments: &ManArguments, commands: Command) -> Result<(), Failure> {
    require_folder(&arguments.out)?;
    let pages = pages(commands)?;
    for (name, page) in &pages {
        write_in_folder(&arguments.out, name, page)?;
    }
    report_line(&format!("manual: {} pages in {}", pages.len(), arguments.out.display()));
    Ok(())
}

/// Returns every page with its file's name: the program's first, then its commands' in their order.
fn pages(commands: Command) -> Result<Vec<(String, String)>, Failure> {
    // `help` says nothing that the pages do not.
    let mut commands = commands.disable_help_subcommand(true);
    commands.build();
    let own = std::iter::once(commands.clone());
    own.chain(commands.get_subcommands().cloned()).map(page).collect()
}

fn page(command: Command) -> Result<(String, String), Failure> {
    let source = concat!("dynocar ", env!("CARGO_PKG_VERSION"));
    let page = Man::new(command).source(source);
    let name = page.get_filename();
    let mut text = Vec::new();
    page.render(&mut text).map_err(|error| Failure::Work(format!("{name}: {error}")))?;
    Ok((name, String::from_utf8_lossy(&text).into_owned()))
}

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
pub fn complete(arguments: &CompletionsArguments, mut commands: Command) -> Result<(), Failure> {
    let name = commands.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut commands, name, &mut script);
    Ok(print(&String::from_utf8_lossy(&script))?)
}
