//! An explanation beside the data that it explains, by the program that knows the format of recordings.

use std::fmt::Display;
use std::path::Path;

use dynocar_analysis::explain::report::timeline::Timeline;
use tempfile::NamedTempFile;

use dynocar::cli::Failure;
use dynocar::dataset::Source;
use dynocar::output::report_line;
use dynocar::programs::{CallFailure, RECORDING, call, output_of};

/// Copies a recording, or the dataset at a path as one, into a new file with an explanation of it.
///
/// # Errors
///
/// A wrong input is what the program found wrong with what it was given.
pub fn annotate(from: Source, timeline: &Timeline, to: &Path) -> Result<(), Failure> {
    let failed = |problem: &dyn Display| Failure::Work(format!("{}: {problem}", to.display()));
    let mut file = NamedTempFile::with_prefix("dynocar-").map_err(|it| failed(&it))?;
    serde_json::to_writer(&mut file, timeline).map_err(|it| failed(&it))?;
    let mut command = call(RECORDING);
    command.arg("annotate").arg(from.path);
    command.arg("--timeline").arg(file.path()).arg("--output").arg(to);
    if let Some(train) = from.train {
        command.arg("--train").arg(train.0.to_string());
    }
    let (_, words) = output_of(RECORDING, &mut command).map_err(|failure| match failure {
        CallFailure::Input(problem) => Failure::Input(problem),
        CallFailure::Work(problem) => failed(&problem),
    })?;
    report_line(&words);
    Ok(())
}
