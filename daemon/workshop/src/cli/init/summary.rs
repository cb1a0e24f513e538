//! Terminal output of `dynocar init`: the written files, every guess, the doubtful ones, the next steps.

use std::path::Path;

use dynocar::models::text::TRAIN_FILE;
use dynocar_analysis::dataset::guess::Guess;
use dynocar_analysis::dataset::{DatasetDiagnostic, MANIFEST_FILE};
use encoding_rs::UTF_8;

use crate::cli::train_text::TrainText;
use crate::report::provenance::for_shell;
use crate::run_facts::diagnostics;
use dynocar::cli::text::{TextTable, entry};

/// Describes the written files, the understanding of the recordings, and the next steps.
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
    let (guess, layout) = (&described.guess, &described.guess.layout);
    let mut text = String::new();
    for (run, file) in guess.runs.iter().zip(&described.files) {
        let falls = if run.direction < 0 { ", the position falls" } else { "" };
        text += &format!("{file}: {} rows{falls}\n", run.rows);
    }
    let delimiter = match layout.delimiter {
        b'\t' => "a tab".into(),
        mark => format!("'{}'", char::from(mark)),
    };
    text += &format!("cells end at {delimiter}, decimals at '{}'\n", char::from(layout.decimal));
    if layout.encoding != UTF_8 {
        let name = layout.encoding.name().to_lowercase();
        text += &format!("letters are {name}: the files are no UTF-8; --encoding says another\n");
    }
    if layout.skip_rows > 0 {
        text += &format!("the names stand in line {}\n", layout.skip_rows + 1);
    }
    if layout.units_row {
        text += "units stand in the line below the names\n";
    }
    text.push('\n');
    let mut table = TextTable::new(
        &["column", "taken for", "unit or format", "sure", "since"],
        &[0, 1, 2, 3, 4],
    );
    for column in &guess.columns {
        let scale = match column.scale {
            1.0 => String::new(),
            scale => format!("{scale} × "),
        };
        table.push(vec![
            std::iter::once(&column.name)
                .chain(&column.parts)
                .map(|name| format!("'{}'", name.shown()))
                .collect::<Vec<_>>()
                .join(" + "),
            column.quantity.to_string(),
            match &column.format {
                Some(format) => format.name().to_owned(),
                None => format!("{scale}{}", column.unit.name()),
            },
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
    text + &diagnostics(&described.diagnostics)
}

/// Returns the commands that come next.
fn next(folder: &Path, described: Option<&Described>) -> String {
    let at = |name: &str| for_shell(&folder.join(name).display().to_string());
    let mut commands = Vec::new();
    if described.is_some() {
        let folder = for_shell(&folder.display().to_string());
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

/// Name of the daemon's configuration.
pub const DAEMON_FILE: &str = "daemon.toml";

/// Understanding of the recordings.
pub struct Described {
    /// The assumed meaning of the columns.
    pub guess: Guess,
    /// The runs' files, as the dataset names them.
    pub files: Vec<String>,
    /// Impossibilities of the runs as they were understood, the worst first.
    pub diagnostics: Vec<DatasetDiagnostic>,
    /// `dataset.toml`.
    pub text: String,
}
