//! Understanding of a path, and its drawings.

use std::path::Path;
use std::sync::Arc;

use dynocar::cli::Failure;
use dynocar::config::DaemonConfig;
use dynocar::dataset::FileKind;
use dynocar::output::{report_line, write_in_folder};
use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::{DatasetDiagnostic, DatasetError, Manifest, Run};
use dynocar_analysis::explain::report::windows::AlongLine;
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;

use crate::report::plots::{Width, as_file, effort, line};

/// Understanding of a path: the contents of a file of this kind, and all that belongs to it.
pub struct Understood {
    /// Kind of the file.
    pub(super) kind: FileKind,
    /// A dataset's file, with the fate of each of its runs.
    pub dataset: Option<(Manifest, Vec<Result<Run, DatasetError>>)>,
    /// A train.
    pub(super) train: Option<Arc<TrainModel>>,
    /// A line.
    pub(super) track: Option<Arc<Track>>,
    /// A daemon's configuration.
    pub(super) daemon: Option<DaemonConfig>,
}

impl Understood {
    /// Returns nothing yet of a file of this kind.
    pub(super) fn from_kind(kind: FileKind) -> Self {
        Understood { kind, dataset: None, train: None, track: None, daemon: None }
    }

    /// Returns the runs of a dataset, or in place of a run its error.
    fn runs(&self) -> &[Result<Run, DatasetError>] {
        self.dataset.as_ref().map_or(&[], |(_, runs)| runs)
    }

    /// Returns the diagnostics that may spoil results, the worst first.
    pub(super) fn diagnostics(&self) -> Vec<DatasetDiagnostic> {
        let Some(train) = &self.train else { return Vec::new() };
        diagnostics(train, self.track.as_deref(), self.runs().iter().flatten())
    }

    /// Returns the errors of single runs.
    pub fn errors(&self) -> impl Iterator<Item = &DatasetError> {
        self.runs().iter().filter_map(|run| run.as_ref().err())
    }
}

/// Draws the line's profile and the train's effort curves into a folder, as far as they are known.
///
/// # Errors
///
/// An input failure where neither a line nor a train is known; a failure of the work where a drawing cannot be made or
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
