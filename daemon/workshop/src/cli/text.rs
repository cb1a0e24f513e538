//! Aligned text for people: what is said of recorded runs and written into files.

use dynocar_analysis::dataset::DatasetDiagnostic;
use dynocar_core::plausibility::Severity;

pub use dynocar::cli::text::{TextTable, WIDTH, line, short, wrap};

/// Notes on a dataset, each from a line of its own; those by which it cannot be true say so.
pub fn diagnostics(diagnostics: &[DatasetDiagnostic]) -> String {
    let line = |diagnostic: &DatasetDiagnostic| {
        let head = match diagnostic.severity {
            Severity::Fundamental => "cannot be true",
            _ => "note",
        };
        format!("{}\n", wrap(&format!("{head}: {diagnostic}"), WIDTH).join("\n  "))
    };
    diagnostics.iter().map(line).collect()
}

/// Words without line breaks and other marks that would end a line.
pub fn on_one_line(words: &str) -> String {
    words.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// A comment of a TOML file, in lines that begin alike.
pub fn comment(indent: &str, words: &str) -> String {
    let lines = wrap(&on_one_line(words), WIDTH - indent.len());
    lines.iter().map(|line| format!("# {indent}{line}\n")).collect()
}

/// A sentence that begins with its subject, the lines after the first further in.
pub fn entry(indent: &str, words: &str) -> String {
    let lines = wrap(words, WIDTH - indent.len());
    format!("{indent}{}\n", lines.join(&format!("\n{indent}  ")))
}
