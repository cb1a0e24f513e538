//! The commands of `dynocar --help`, in groups by their purpose.

use std::fmt::Write;

use clap::Command;

/// Headings and their commands, in the order in which they are printed.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Begin", &["demo", "init", "import", "check"]),
    ("Drive, with a controller", &["run", "health", "replay"]),
    (
        "Learn, from recorded runs",
        &["identify", "explain", "survey", "stops", "brakes", "learn", "models"],
    ),
    ("Look, and keep", &["watch", "record", "flight-recorder", "keep", "recover", "convert"]),
    ("Connect, with other programs", &["live", "fmu", "completions", "man"]),
];

/// Returns the program's command line with a help that lists its commands in groups.
pub fn grouped(command: Command) -> Command {
    let list = list(&command);
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}{list}\n\nOptions:\n{{options}}\n\n\
         dynocar help COMMAND says more of one of them."
    ))
}

/// Returns the commands that there are, each with its first sentence, below the headings.
fn list(command: &Command) -> String {
    let names = || command.get_subcommands().map(Command::get_name);
    let width = names().map(str::len).max().unwrap_or_default();
    let mut list = String::new();
    for (heading, wanted) in GROUPS {
        let found: Vec<&Command> =
            wanted.iter().filter_map(|name| command.find_subcommand(name)).collect();
        if !found.is_empty() {
            let _ = write!(list, "\n\n{heading}:");
        }
        for it in found {
            let about = it.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = write!(list, "\n  {:width$}  {about}", it.get_name());
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::{GROUPS, list};

    #[test]
    fn every_command_is_in_one_group_and_its_first_sentence_fits_a_line() {
        let command = crate::cli::commands();
        for it in command.get_subcommands().filter(|it| !it.is_hide_set()) {
            let name = it.get_name();
            let count =
                GROUPS.iter().flat_map(|(_, names)| *names).filter(|it| **it == name).count();
            assert_eq!(count, 1, "{name} is in {count} groups");
        }
        for line in list(&command).lines() {
            assert!(line.chars().count() <= 100, "{line}");
        }
    }
}
