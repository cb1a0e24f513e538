//! What `dynocar import` says on the terminal: of every field what became of it, and what to do next.

use std::path::Path;

use dynocar_analysis::dataset::DatasetDiagnostic;
use dynocar_analysis::import::{Account, FieldOutcome, ImportedLine, ImportedTrain};

use crate::cli::text::{TextTable, diagnostics, entry, for_shell, on_one_line};
use crate::cli::train_text::TrainText;

/// What was taken, what was not, what is left to do.
pub fn text(
    folder: &Path,
    train: Option<&(&ImportedTrain, TrainText)>,
    line: Option<&(&ImportedLine, String)>,
    of_result: &[DatasetDiagnostic],
    written: &[&str],
) -> String {
    let mut text = String::new();
    if let Some((train, made)) = train {
        text += &entry("", &on_one_line(&format!("train '{}' of {}", train.name, train.place)));
        text += &account(&train.account);
        if !made.defaults.is_empty() {
            let defaults = made.defaults.join(", ");
            text += &entry("", &format!("defaults in train.toml, nobody's figures: {defaults}"));
        }
        text.push('\n');
    }
    if let Some((line, _)) = line {
        text += &entry("", &on_one_line(&format!("line '{}' of {}", line.name, line.place)));
        text += &account(&line.account);
        text.push('\n');
    }
    text += &diagnostics(of_result);
    let paths = || written.iter().map(|name| folder.join(name).display().to_string());
    text += &format!("written: {}\n\nnext:\n", paths().collect::<Vec<_>>().join(", "));
    for path in paths() {
        let drawings = for_shell(&folder.display().to_string());
        text += &format!("  dynocar check {} --draw {drawings}\n", for_shell(&path));
    }
    text
}

fn account(account: &Account) -> String {
    let mut table = TextTable::new(&["field", "taken as", "how"], &[0, 1, 2]);
    let mut rest = String::new();
    for outcome in account.outcomes() {
        match outcome {
            FieldOutcome::Taken { field, key, how } => {
                table.push(vec![on_one_line(field), (*key).into(), on_one_line(how)]);
            }
            FieldOutcome::Left { field, why } => {
                rest += &entry("  ", &on_one_line(&format!("not taken: '{field}': {why}")));
            }
            FieldOutcome::Unknown { key, why } => {
                rest += &entry("  ", &on_one_line(&format!("not in the file: {key}: {why}")));
            }
        }
    }
    format!("{table}{rest}")
}
