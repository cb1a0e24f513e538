//! `dynocar explain --annotate`: an explanation beside the data that it explains.

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

use clap::Args;
use dynocar::cli::Failure;
use dynocar::output::{report_line, require_new};
use dynocar_analysis::explain::report::timeline::Timeline;

use crate::annotate::annotate;
use crate::convert::from_dataset;

/// Add an explanation to a copy of the recording that it explains.
#[derive(Debug, Args)]
pub struct AnnotateArguments {
    /// The recording, or the dataset, that was explained
    from: PathBuf,
    /// The explanation in time, as JSON
    #[arg(long, value_name = "FILE")]
    timeline: PathBuf,
    /// The new recording
    #[arg(short, long, value_name = "FILE.mcap")]
    output: PathBuf,
    /// The train that was explained, where the recording holds several
    #[arg(long, value_name = "ID")]
    train: Option<u64>,
}

/// Writes the copy.
///
/// # Errors
///
/// A recording that cannot be read, or is another, is an input failure.
pub fn execute(arguments: &AnnotateArguments) -> Result<(), Failure> {
    let AnnotateArguments { from, timeline, output, train } = arguments;
    require_new(output)?;
    let wrong = |error: serde_json::Error| {
        Failure::Input(format!("{}: no explanation in time: {error}", timeline.display()))
    };
    let file = File::open(timeline).map_err(|error| wrong(serde_json::Error::io(error)))?;
    let read: Timeline = serde_json::from_reader(BufReader::new(file)).map_err(wrong)?;
    let added = if from.is_dir() || from.extension().is_some_and(|it| it == "toml") {
        let folder = tempfile::TempDir::with_prefix("dynocar-").map_err(Failure::work)?;
        let recording = folder.path().join("dataset.mcap");
        from_dataset(from, &recording)?;
        annotate(&recording, *train, &read, output)?
    } else {
        annotate(from, *train, &read, output)?
    };
    report_line(&format!(
        "annotated recording: {}: {} intervals in which an effect acts, {} messages in all",
        output.display(),
        added.effects,
        added.messages
    ));
    Ok(())
}
