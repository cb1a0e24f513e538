//! What `dynocar init` says on the terminal: every guess, what is doubtful, and what to do next.

use std::path::Path;

use super::described::{DAEMON_FILE, Described, TRAIN_FILE};
use super::train_text::TrainText;
use crate::cli::text::{TextTable, WIDTH, notes, wrap};
use dynocar_core::dataset::MANIFEST_FILE;

/// What was written, understood and is left to do.
pub fn text(folder: &Path, train: &TrainText, described: Option<&Described>) -> String {
    let mut text = String::new();
    if let Some(described) = described {
        text += &recordings(described);
    }
    if !train.defaults.is_empty() {
        text += &entry(
            "",
            &format!("defaults in {TRAIN_FILE}, nobody's figures: {}", train.defaults.join(", ")),
        );
    }
    let names = [Some(TRAIN_FILE), Some(DAEMON_FILE), described.map(|_| MANIFEST_FILE)];
    let written = names.into_iter().flatten();
    let written: Vec<String> =
        written.map(|name| folder.join(name).display().to_string()).collect();
    text += &format!("written: {}\n", written.join(", "));
    text + &next(folder, described)
}

fn recordings(described: &Described) -> String {
    let guess = &described.guess;
    let mut text = String::new();
    for (run, file) in guess.runs.iter().zip(&described.files) {
        let falls = if run.direction < 0 { ", the position falls" } else { "" };
        text += &format!("{file}: {} rows{falls}\n", run.rows);
    }
    let delimiter = match guess.delimiter {
        b'\t' => "a tab".into(),
        mark => format!("'{}'", char::from(mark)),
    };
    text += &format!("cells end at {delimiter}, decimals at '{}'\n\n", char::from(guess.decimal));
    let mut table =
        TextTable::new(&["column", "taken for", "unit", "sure", "since"], &[0, 1, 2, 3, 4]);
    for column in &guess.columns {
        let scale = match column.scale {
            1.0 => String::new(),
            scale => format!("{scale} × "),
        };
        table.push(vec![
            format!("'{}'", column.name.shown()),
            column.quantity.to_string(),
            format!("{scale}{}", column.unit.name()),
            if column.doubts.is_empty() { "yes".into() } else { "NO".into() },
            column.reasons.join("; "),
        ]);
    }
    text += &table.to_string();
    for column in &guess.unmapped {
        text += &entry("  ", &format!("not mapped: '{}': {}", column.name.shown(), column.reason));
    }
    text.push('\n');
    for column in &guess.columns {
        for doubt in &column.doubts {
            text += &entry("", &format!("doubtful: {}: {doubt}", column.quantity));
        }
    }
    text + &notes(&described.notes)
}

fn entry(indent: &str, words: &str) -> String {
    let lines = wrap(words, WIDTH - indent.len());
    format!("{indent}{}\n", lines.join(&format!("\n{indent}  ")))
}

/// The commands that come next.
fn next(folder: &Path, described: Option<&Described>) -> String {
    let at = |name: &str| quoted(&folder.join(name).display().to_string());
    let mut commands = Vec::new();
    if described.is_some() {
        let folder = quoted(&folder.display().to_string());
        commands.push((format!("dynocar check {}", at(MANIFEST_FILE)), "what was understood"));
        commands.push((format!("dynocar identify {folder}"), "resistance and mass from the runs"));
        let report = at("report.html");
        let explain = format!("dynocar explain {folder} --report {report}");
        commands.push((explain, "what the model lacks"));
    } else {
        commands.push((format!("dynocar check {}", at(TRAIN_FILE)), "what was understood"));
    }
    commands.push((format!("dynocar run --config {}", at(DAEMON_FILE)), "the daemon"));
    let mut text = String::from("\nnext, once the files say what is true of your train:\n");
    for (command, what) in commands {
        text += &format!("  {command}    # {what}\n");
    }
    text
}

/// A path as a shell takes it.
fn quoted(path: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "/._-+@%:,".contains(letter);
    if !path.is_empty() && path.chars().all(is_plain) {
        return path.into();
    }
    format!("'{}'", path.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_quoted_for_a_shell_where_they_must_be() {
        assert_eq!(quoted("a/b-1.toml"), "a/b-1.toml");
        assert_eq!(quoted("my train"), "'my train'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
    }
}
