//! `dynocar replay --verify`: every snapshot of a recording computed again.

use std::path::PathBuf;

use clap::Args;
use dynocar::cli::Failure;
use dynocar::config::DaemonConfig;
use dynocar::output::{print, report_line};

use crate::formats;
use crate::verify::{ComparisonOutcome, Configurations, overlay, text, verify};

/// Compute every recorded snapshot again.
#[derive(Debug, Args)]
pub struct VerifyArguments {
    /// The recording; of one that rotated, its files in order
    #[arg(required = true)]
    recording: Vec<PathBuf>,
    /// Also print the estimates that this configuration of the daemon would have given
    #[arg(long, value_name = "FILE")]
    with: Option<PathBuf>,
}

/// Computes every snapshot of a recording again, and reports the comparison.
///
/// # Errors
///
/// When the recording holds no snapshots or no configuration, or a computed snapshot differs.
pub fn execute(arguments: &VerifyArguments) -> Result<(), Failure> {
    let VerifyArguments { recording: paths, with } = arguments;
    let recording = &(formats::of_recording(paths).whole)(paths).map_err(Failure::Input)?;
    let path = &paths[0];
    if let Some(broken) = &recording.broken {
        report_line(&format!("dynocar: {broken}"));
    }
    if recording.snapshots.is_empty() {
        let words = "no snapshots: nothing to verify";
        return Err(Failure::Input(format!("{}: {words}", path.display())));
    }
    let configurations = Configurations::from_recording(recording);
    let configurations =
        configurations.map_err(|it| Failure::Input(format!("{}: {it}", path.display())))?;
    let other = with.as_deref().map(DaemonConfig::load).transpose()?;
    let verified = verify(recording, &configurations);
    let (samples, snapshots) = (recording.samples.len(), recording.snapshots.len());
    let names = paths.iter().map(|it| it.display().to_string()).collect::<Vec<_>>();
    let names = names.join(", ");
    print(&format!("{names}: {samples} samples, {snapshots} snapshots\n"))?;
    print(&text(&verified))?;
    if let (Some(other), Some(file)) = (&other, with) {
        let newest = verified.last().map_or(0, |it| it.epoch);
        let recorded = configurations.of_epoch(newest).0;
        print(&overlay([recorded, other], &recording.samples, &file.display().to_string()))?;
    }
    if verified.iter().all(|it| it.outcome == ComparisonOutcome::Same) {
        Ok(())
    } else {
        Err(Failure::Verdict(1))
    }
}
