//! The runs of a dataset that is explained: all of them in memory where they are few, else only those that the search
//! uses.

use std::borrow::Cow;
use std::path::PathBuf;

use dynocar_analysis::dataset::{
    Dataset, DatasetError, DatasetFiles, DatasetHead, FORCE_NOT_RECORDED, Run, SourcePosition,
};
use dynocar_analysis::explain::evidence::{Density, RunData, RunDataError};
use dynocar_analysis::explain::many::{Held, Many};
use dynocar_analysis::explain::selection::Progress;
use dynocar_analysis::explain::{Explanation, explain, explain_many};
use dynocar_analysis::parallel;

use crate::dataset::{FilesOfDataset, open};
use dynocar::cli::Failure;
use dynocar::dataset::{DatasetSource, LoadError};
use dynocar_shared::TrainId;

/// The runs of a dataset.
pub struct ExplainedRuns {
    /// All runs; where they are many, without their samples.
    pub dataset: Dataset,
    path: PathBuf,
    train: Option<TrainId>,
    traction_only: bool,
    many: Option<ManyRuns>,
}

/// Many runs, of which some are in memory.
struct ManyRuns {
    folder: FilesOfDataset,
    head: DatasetHead,
    held: Held,
    /// Those that are, until they are explained.
    chosen: Dataset,
}

/// Why the runs are not explained.
enum Problem {
    Unread(DatasetError),
    Unusable(RunDataError),
}

impl From<RunDataError> for Problem {
    fn from(error: RunDataError) -> Self {
        Problem::Unusable(error)
    }
}

impl ExplainedRuns {
    /// Returns those of the dataset at a path.
    ///
    /// # Errors
    ///
    /// The first mistake, with file, line and choices.
    pub fn at(source: DatasetSource, traction_only: bool) -> Result<Self, Failure> {
        let (folder, head) = open(source)?;
        let held = Held::of(head.manifest.runs.iter().map(|run| run.role));
        let read = |index| {
            let mut run = read(&folder, &head, traction_only, index)?;
            let is_held = held.as_ref().is_none_or(|held| held.holds(index));
            let whole = run.split_off_samples();
            Ok((run, is_held.then_some(whole)))
        };
        let runs = parallel::of_each_number(head.manifest.runs.len(), read).into_iter();
        let runs: Result<Vec<(Run, Option<Run>)>, DatasetError> = runs.collect();
        let (known, chosen): (Vec<Run>, Vec<Option<Run>>) =
            runs.map_err(LoadError::from)?.into_iter().unzip();
        let dataset = |runs| Dataset { runs, ..head.without_runs() };
        let chosen = dataset(chosen.into_iter().flatten().collect());
        let (path, train) = (source.path.to_path_buf(), source.train);
        let Some(held) = held else {
            return Ok(ExplainedRuns { dataset: chosen, path, train, traction_only, many: None });
        };
        let dataset = dataset(known);
        let many = Some(ManyRuns { folder, head, held, chosen });
        Ok(ExplainedRuns { dataset, path, train, traction_only, many })
    }

    /// Returns where they lie.
    pub fn source(&self) -> DatasetSource<'_> {
        DatasetSource { path: &self.path, train: self.train }
    }

    /// Explains them.
    ///
    /// # Errors
    ///
    /// When a run has no usable sample, or cannot be read any more.
    pub fn explain(&mut self, progress: Progress) -> Result<Explanation, Failure> {
        let Some(many) = &mut self.many else {
            return explain(&self.dataset, progress).map_err(|error| self.unusable(error));
        };
        let declared = many.chosen.without_runs();
        let chosen = std::mem::replace(&mut many.chosen, declared);
        let ManyRuns { folder, head, held, .. } = &*many;
        let read = |index| read(folder, head, self.traction_only, index).map_err(Problem::Unread);
        let many = Many { dataset: &self.dataset, held, read: &read };
        explain_many(chosen, many, progress).map_err(|problem| match problem {
            Problem::Unread(error) => LoadError::from(error).into(),
            Problem::Unusable(error) => self.unusable(error),
        })
    }

    /// Returns a run made ready for the models of an explanation, by its place.
    ///
    /// # Errors
    ///
    /// When it cannot be read any more.
    pub fn prepared<'e>(
        &self,
        index: usize,
        explanation: &'e Explanation,
    ) -> Result<Cow<'e, RunData>, Failure> {
        let Some(ManyRuns { folder, head, .. }) = &self.many else {
            let file = &self.dataset.runs[index].file;
            let mut all = explanation.problem.runs.iter().chain(&explanation.holdout);
            let known = all.find(|run| run.file == *file);
            return known.map(Cow::Borrowed).ok_or_else(|| Failure::work(file));
        };
        let run = read(folder, head, self.traction_only, index).map_err(LoadError::from)?;
        let run = explanation.preparation.run(run, Density::Recorded);
        run.map(Cow::Owned).map_err(|error| self.unusable(error))
    }

    /// Returns the failure of a run that cannot be used, with the possible causes.
    fn unusable(&self, error: RunDataError) -> Failure {
        let RunDataError::Simulate { file, source } = error;
        let label =
            FilesOfDataset::at(self.source()).map_or(file.clone(), |folder| folder.label(&file));
        let of_dataset = self.dataset.diagnostics();
        let run = self.dataset.runs.iter().find(|run| run.file == file);
        let unrecorded = run.into_iter().flat_map(|run| &run.diagnostics);
        let unrecorded = unrecorded.filter(|it| it.code == FORCE_NOT_RECORDED);
        let of_dataset = of_dataset.iter().map(|diagnostic| format!("; {diagnostic}"));
        let of_run = unrecorded.map(|diagnostic| format!("; {}", diagnostic.text));
        let diagnostics: String = of_dataset.chain(of_run).collect();
        Failure::At(SourcePosition::whole(&label), format!("{label}: {source}{diagnostics}"))
    }
}

/// Reads one run.
fn read(
    folder: &FilesOfDataset,
    head: &DatasetHead,
    traction_only: bool,
    index: usize,
) -> Result<Run, DatasetError> {
    let mut run = head.read_run(folder, index)?;
    if traction_only {
        run.keep_traction_only();
    }
    Ok(run)
}
