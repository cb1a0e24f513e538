//! An explanation beside the data that it explains.

use std::path::Path;

use crate::from_dataset::from_dataset;
use dynocar::cli::Failure;
use dynocar::dataset::DatasetSource;
use dynocar::output::report_line;
use dynocar_analysis::explain::report::timeline::Timeline;
use dynocar_mcap::annotate;
use tempfile::TempDir;

/// Copies a recording, or the dataset at a path as one, into a new file with an explanation of it.
///
/// # Errors
///
/// A recording that cannot be read is an input failure.
pub fn annotate(from: DatasetSource, timeline: &Timeline, to: &Path) -> Result<(), Failure> {
    let DatasetSource { path, train } = from;
    let train = train.map(|it| it.0);
    let added = if path.is_dir() || path.extension().is_some_and(|it| it == "toml") {
        let folder = TempDir::with_prefix("dynocar-").map_err(Failure::work)?;
        let recording = folder.path().join("dataset.mcap");
        from_dataset(path, &recording)?;
        annotate::annotate(&recording, train, timeline, to)?
    } else {
        annotate::annotate(path, train, timeline, to)?
    };
    report_line(&format!(
        "annotated recording: {}: {} intervals in which an effect acts, {} messages in all",
        to.display(),
        added.effects,
        added.messages
    ));
    Ok(())
}
