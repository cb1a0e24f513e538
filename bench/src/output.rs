//! Results for people and for machines, with errors as this program reports them: text and exit status.

use std::path::{Path, PathBuf};

use serde::Serialize;

/// Gives a result; an error has its text and the exit status.
pub fn give(
    json: &Option<PathBuf>,
    result: &impl Serialize,
    for_people: impl FnOnce() -> String,
) -> Result<(), (String, u8)> {
    dynocar::output::give(json.as_deref(), result, for_people)
        .map_err(|error| (error.to_string(), 1))
}

/// A row of a table of figures: each column's name with its cell, empty where there is no figure.
pub type CsvRow = Vec<(&'static str, String)>;

/// Writes rows with the same columns as CSV under a line of their names; an error has its text and the exit status.
pub fn write_csv(file: &Path, rows: &[CsvRow]) -> Result<(), (String, u8)> {
    let refused = |error: csv::Error| (format!("{}: {error}", file.display()), 1);
    let mut writer = csv::Writer::from_path(file).map_err(refused)?;
    if let Some(first) = rows.first() {
        writer.write_record(first.iter().map(|(name, _)| name)).map_err(refused)?;
    }
    for row in rows {
        writer.write_record(row.iter().map(|(_, cell)| cell)).map_err(refused)?;
    }
    writer.flush().map_err(|error| refused(error.into()))
}

/// A figure with so many decimals; empty where there is none.
pub fn cell(value: Option<f64>, decimals: usize) -> String {
    value.filter(|it| it.is_finite()).map_or(String::new(), |it| format!("{it:.decimals$}"))
}
