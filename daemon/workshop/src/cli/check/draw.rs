//! The line and the train as drawings.

use std::path::Path;

use dynocar_analysis::explain::report::residual_line::AlongLine;

use super::Understood;
use crate::report::plots::Width;
use crate::report::plots::{as_file, effort, line};
use dynocar::cli::Failure;
use dynocar::output::{report_line, write_in_folder};

/// Draws the line's profile and the train's effort curves into a folder, as far as they are known.
///
/// # Errors
///
/// An input failure for what has neither; a failure of the work where a drawing cannot be made or
/// written.
pub(super) fn draw(understood: &Understood, folder: &Path) -> Result<(), Failure> {
    if understood.daemon.is_some() {
        return Err(Failure::Input(
            "--draw: expected a dataset, a train or a track, not a daemon's configuration".into(),
        ));
    }
    let (train, track) = (understood.train.as_deref(), understood.track.as_deref());
    let failed = |error| Failure::Work(format!("the drawing failed: {error}"));
    let line = line::draw(track, &AlongLine::default(), false, Width::Wide).map_err(failed)?;
    let line = line.map(|plot| plot.svg);
    let effort = train.map(effort::draw).transpose().map_err(failed)?.flatten();
    let drawn = [("line.svg", line), ("effort.svg", effort)];
    if drawn.iter().all(|(_, plot)| plot.is_none()) {
        report_line(
            "nothing drawn: no gradient, curves or permitted speed of a line, no effort of a train",
        );
    }
    for (name, plot) in drawn {
        if let Some(plot) = plot {
            let path = write_in_folder(folder, name, &as_file(&plot))?;
            report_line(&format!("drawn: {}", path.display()));
        }
    }
    Ok(())
}
