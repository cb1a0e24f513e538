//! What was understood of a path.

use dynocar_analysis::dataset::dataset_diagnostic::diagnostics;
use dynocar_analysis::dataset::{DatasetDiagnostic, DatasetError, DatasetHead, Run};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;

use dynocar::config::DaemonConfig;
use dynocar::dataset::FileKind;

/// What was understood.
pub enum Understood {
    /// A dataset, with what became of each of its runs.
    Dataset(Box<DatasetHead>, Vec<Result<Run, DatasetError>>),
    /// A train.
    Train(Box<TrainModel>),
    /// A line.
    Track(Box<Track>),
    /// A daemon's configuration.
    Daemon(Box<DaemonConfig>),
}

impl Understood {
    /// What it was read from.
    pub(super) fn kind(&self) -> FileKind {
        match self {
            Understood::Dataset(..) => FileKind::Dataset,
            Understood::Train(_) => FileKind::Train,
            Understood::Track(_) => FileKind::Track,
            Understood::Daemon(_) => FileKind::Daemon,
        }
    }

    /// What may spoil results, the worst first.
    pub(super) fn diagnostics(&self) -> Vec<DatasetDiagnostic> {
        match self {
            Understood::Dataset(head, runs) => {
                diagnostics(&head.train, head.track.as_deref(), runs.iter().flatten())
            }
            Understood::Train(train) => diagnostics(train, None, []),
            Understood::Track(_) | Understood::Daemon(_) => Vec::new(),
        }
    }

    /// What is wrong with single runs.
    pub fn errors(&self) -> impl Iterator<Item = &DatasetError> {
        let runs = match self {
            Understood::Dataset(_, runs) => &runs[..],
            Understood::Train(_) | Understood::Track(_) | Understood::Daemon(_) => &[],
        };
        runs.iter().filter_map(|run| run.as_ref().err())
    }
}
