//! Understanding of a path.

use std::sync::Arc;

use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::{DatasetDiagnostic, DatasetError, Manifest, Run};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;

use dynocar::config::DaemonConfig;
use dynocar::dataset::FileKind;

/// Understanding of a path: the contents of a file of this kind, and all that belongs to it.
pub struct Understood {
    /// Kind of the file.
    pub(super) kind: FileKind,
    /// A dataset's file, with what became of each of its runs.
    pub dataset: Option<(Manifest, Vec<Result<Run, DatasetError>>)>,
    /// A train.
    pub(super) train: Option<Arc<TrainModel>>,
    /// A line.
    pub(super) track: Option<Arc<Track>>,
    /// A daemon's configuration.
    pub(super) daemon: Option<DaemonConfig>,
}

impl Understood {
    /// Nothing yet of a file of this kind.
    pub(super) fn of(kind: FileKind) -> Self {
        Understood { kind, dataset: None, train: None, track: None, daemon: None }
    }

    /// The runs of a dataset, each or what is wrong with it.
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
