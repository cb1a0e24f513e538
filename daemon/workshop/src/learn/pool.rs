//! Runs that are explained together, within bounds of memory: a dataset with the train and line of the model in force.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use dynocar::dataset::LoadError;
use dynocar::models::ModelText;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar_analysis::dataset::written::name_model;
use dynocar_analysis::dataset::{
    Dataset, DatasetFiles, DatasetHead, FileProblem, MANIFEST_FILE, Manifest, Role, Run, RunContent,
};
use dynocar_analysis::explain::evidence::RunDataError;
use dynocar_analysis::explain::many::{Held, Many};
use dynocar_analysis::explain::selection::Progress;
use dynocar_analysis::explain::{Explanation, explain, explain_many};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use toml::Table;
use tracing::warn;

use super::available_runs::{FoundRun, report_unusable};
use super::memory::LearnerMemory;
use crate::dataset::FilesOfDataset;

/// Bounds of the runs that are explained together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Greatest number of runs, before all of them are taken.
    pub runs: usize,
    /// Greatest total time of these runs.
    pub time: Duration,
    /// Greatest number of samples in memory.
    pub samples: usize,
    /// Age, counted from the newest run, below which runs are first explained by themselves.
    pub recent: Duration,
    /// Age, counted from the newest run, above which runs are not used.
    pub horizon: Duration,
}

impl Default for Bounds {
    fn default() -> Self {
        let days = |days: u64| Duration::from_secs(86_400 * days);
        Bounds {
            runs: 40,
            time: Duration::from_secs(12 * 3600),
            samples: 2_000_000,
            recent: days(2),
            horizon: days(30),
        }
    }
}

/// Share of the runs, the last ones, that judge.
const HELD_OUT_SHARE: f64 = 0.2;

/// Runs that are explained together.
#[derive(Debug)]
pub struct Pool {
    /// The runs as one dataset; where they are many, without their samples.
    pub dataset: Dataset,
    /// Where they lie, in the same order.
    pub runs: Vec<FoundRun>,
    /// Which of many runs the search uses.
    held: Option<Held>,
}

/// A run that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub struct UnusableRun {
    /// Its name.
    pub name: String,
    /// Why.
    pub problem: String,
}

impl From<RunDataError> for UnusableRun {
    fn from(error: RunDataError) -> Self {
        let problem = error.to_string();
        let RunDataError::Simulate { file: name, .. } = error;
        UnusableRun { name, problem }
    }
}

/// Returns the choices of runs that are explained, one after the other until one shows an effect: the recent ones, in
/// which something new shows undiluted, then these with a sample of all before, then all.
pub fn choices(runs: &[FoundRun], bounds: &Bounds) -> Vec<Vec<FoundRun>> {
    let Some(newest) = runs.last() else { return Vec::new() };
    let since_s = newest.recorded.unix_s.saturating_sub(bounds.recent.as_secs());
    let begin = runs.partition_point(|run| run.recorded.unix_s < since_s);
    let (older, recent) = runs.split_at(begin);
    let recent = &recent[recent.len().saturating_sub(bounds.runs)..];
    let mut choices = vec![recent.to_vec()];
    // A quarter is always reserved for the older runs, against which new effects show.
    let own = recent.len().min(bounds.runs - bounds.runs / 4);
    let places = spread(older.len(), bounds.runs - own);
    if !places.is_empty() {
        let mut mixed: Vec<FoundRun> = places.into_iter().map(|it| older[it].clone()).collect();
        mixed.extend_from_slice(&recent[recent.len() - own..]);
        choices.push(mixed);
    }
    if runs.len() > bounds.runs {
        choices.push(runs.to_vec());
    }
    choices
}

/// Returns at most `most` places of a list, evenly spread over it.
fn spread(length: usize, most: usize) -> BTreeSet<usize> {
    let count = length.min(most);
    (0..count).map(|k| (2 * k + 1) * length / (2 * count)).collect()
}

/// A declared model, as text and as read, and the dataset that was read last under it.
pub struct Declared<'d> {
    text: &'d ModelText,
    train: Arc<TrainModel>,
    track: Option<Arc<Track>>,
    opened: Mutex<Option<Arc<OpenedDataset<'d>>>>,
}

impl<'d> Declared<'d> {
    /// Of a train and, where one is declared, its line.
    pub fn new(text: &'d ModelText, (train, track): (TrainModel, Option<Track>)) -> Self {
        let (train, track) = (Arc::new(train), track.map(Arc::new));
        Declared { text, train, track, opened: Mutex::new(None) }
    }

    /// Reads a run.
    fn read(&self, found: &FoundRun) -> Result<Run, UnusableRun> {
        let unusable = |problem| UnusableRun { name: found.name.clone(), problem };
        let dataset = self.dataset_of(found).map_err(|error| unusable(error.to_string()))?;
        let OpenedDataset { files, head, .. } = &*dataset;
        // The description may have changed since the runs were found.
        if found.index >= head.manifest.runs.len() {
            return Err(unusable(format!("{}: no longer described", found.name)));
        }
        let run = head.read_run(files, found.index);
        run.map_err(|error| unusable(error.to_string()))
    }

    fn dataset_of(&self, found: &FoundRun) -> Result<Arc<OpenedDataset<'d>>, LoadError> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = opened.as_ref().filter(|it| it.folder == found.dataset) {
            return Ok(Arc::clone(known));
        }
        let files = Overlay::at(&found.dataset, self.text)?;
        let head = DatasetHead::open(&files)?;
        let folder = found.dataset.clone();
        Ok(Arc::clone(opened.insert(Arc::new(OpenedDataset { folder, files, head }))))
    }

    fn dataset(&self, runs: Vec<Run>) -> Dataset {
        Dataset {
            name: format!("train {}", self.train.name),
            description: None,
            train: Arc::clone(&self.train),
            track: self.track.clone(),
            runs,
        }
    }
}

/// Reads runs under a model; unreadable runs are reported once and left out. Few runs are read from the newest until
/// the bounds are reached. `None` where fewer than two are left, one to fit and one to judge, and where those that the
/// search of many uses exceed the memory.
pub fn read(
    chosen: &[FoundRun],
    declared: &Declared,
    bounds: &Bounds,
    memory: &mut LearnerMemory,
) -> Option<Pool> {
    let is_few = held_of(chosen.len()).is_none();
    let mut kept: Vec<(FoundRun, Run)> = Vec::new();
    let (mut time_s, mut samples) = (0.0, Vec::new());
    for found in chosen.iter().rev() {
        if memory.unusable.contains_key(&found.key()) {
            continue;
        }
        let mut run = match declared.read(found) {
            Ok(run) => run,
            Err(unusable) => {
                report_unusable(memory, &found.key(), &unusable.problem);
                continue;
            }
        };
        time_s += duration_s(&run);
        samples.push(run.samples.len());
        let is_within =
            time_s <= bounds.time.as_secs_f64() && samples.iter().sum::<usize>() <= bounds.samples;
        if is_few && !is_within && kept.len() > 1 {
            break;
        }
        if !is_few {
            run.split_off_samples();
        }
        kept.push((found.clone(), run));
    }
    kept.reverse();
    samples.reverse();
    let (runs, mut known): (Vec<FoundRun>, Vec<Run>) = kept.into_iter().unzip();
    let held = held_of(runs.len()).filter(|_| !is_few);
    if !is_few && held.is_none() {
        return read(&runs, declared, bounds, memory);
    }
    if let Some(held) = &held {
        let of_held = samples.iter().enumerate().filter(|(index, _)| held.holds(*index));
        let (in_memory, most) = (of_held.map(|it| it.1).sum::<usize>(), bounds.samples);
        if in_memory > most {
            let count = runs.len();
            warn!(
                "{count} runs are not explained together: {in_memory} samples, expected {most} at most"
            );
            return None;
        }
    }
    let places = roles(runs.len()).enumerate();
    for ((found, run), place) in runs.iter().zip(&mut known).zip(places) {
        enroll(run, found, place);
    }
    (runs.len() > 1).then(|| Pool { dataset: declared.dataset(known), runs, held })
}

/// Returns the roles of some number of runs: the last ones are held out.
fn roles(count: usize) -> impl Iterator<Item = Role> + Clone {
    let held_out = (HELD_OUT_SHARE * count as f64).ceil() as usize;
    let fit = count - held_out.min(count.saturating_sub(1));
    (0..count).map(move |index| if index < fit { Role::Fit } else { Role::Holdout })
}

/// Returns which of some number of runs the search uses; `None` where it uses all.
fn held_of(count: usize) -> Option<Held> {
    Held::of(roles(count))
}

/// Names and numbers a run of a pool by its place, and gives it its role.
fn enroll(run: &mut Run, found: &FoundRun, (index, role): (usize, Role)) {
    run.file.clone_from(&found.name);
    (run.role, run.number) = (role, index as u32 + 1);
    run.samples.iter_mut().for_each(|sample| sample.run = run.number);
}

impl Pool {
    /// Explains the runs; many are read again, one after the other.
    ///
    /// # Errors
    ///
    /// The first run that cannot be used.
    pub fn explain(
        &self,
        declared: &Declared,
        progress: Progress,
    ) -> Result<Explanation, UnusableRun> {
        let Some(held) = &self.held else { return Ok(explain(&self.dataset, progress)?) };
        let read = |index: usize| {
            let found = &self.runs[index];
            let mut run = declared.read(found)?;
            enroll(&mut run, found, (index, self.dataset.runs[index].role));
            Ok::<_, UnusableRun>(run)
        };
        let chosen = (0..self.runs.len()).filter(|index| held.holds(*index)).map(read);
        let chosen = declared.dataset(chosen.collect::<Result<_, _>>()?);
        explain_many(chosen, Many { dataset: &self.dataset, held, read: &read }, progress)
    }
}

/// The dataset whose runs are read.
struct OpenedDataset<'m> {
    folder: PathBuf,
    files: Overlay<'m>,
    head: DatasetHead,
}

fn duration_s(run: &Run) -> f64 {
    match (run.samples.first(), run.samples.last()) {
        (Some(first), Some(last)) => (last.time_ns - first.time_ns) as f64 * 1e-9,
        _ => 0.0,
    }
}

/// The files of a dataset, but for those of train and line.
#[derive(Debug)]
pub struct Overlay<'a> {
    dataset: FilesOfDataset,
    model: &'a ModelText,
}

impl<'a> Overlay<'a> {
    /// Returns the dataset in a folder with a model.
    ///
    /// # Errors
    ///
    /// When there is no dataset.
    pub fn at(folder: &Path, model: &'a ModelText) -> Result<Self, LoadError> {
        Ok(Overlay { dataset: FilesOfDataset::at(folder)?, model })
    }

    /// Returns the description, which names the files of the model.
    fn described(&self, text: String) -> String {
        let Ok(mut table) = text.parse::<Table>() else { return text };
        name_model(&mut table, TRAIN_FILE, self.model.track.as_ref().map(|_| TRACK_FILE));
        table.to_string()
    }
}

impl DatasetFiles for Overlay<'_> {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        match (path, &self.model.track) {
            (TRAIN_FILE, _) => Ok(self.model.train.clone()),
            (TRACK_FILE, Some(track)) => Ok(track.clone()),
            (MANIFEST_FILE, _) => self.dataset.read(path).map(|text| self.described(text)),
            _ => self.dataset.read(path),
        }
    }

    fn read_run(&self, path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        self.dataset.read_run(path, manifest)
    }

    fn label(&self, path: &str) -> String {
        match path {
            TRAIN_FILE | TRACK_FILE => format!("{path} of the model in force"),
            _ => self.dataset.label(path),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynocar::models::UtcSecond;

    fn run(day: u64, number: usize) -> FoundRun {
        FoundRun {
            name: format!("{day}/{number}"),
            dataset: PathBuf::new(),
            index: 0,
            path: PathBuf::new(),
            recorded: UtcSecond { unix_s: 86_400 * (20_000 + day) + number as u64 },
            sha256: format!("{day}-{number}"),
            described: String::new(),
        }
    }

    #[test]
    fn the_last_fifth_is_held_out_and_many_runs_begin_where_a_search_leaves_some_out() {
        let held_out = |count| roles(count).filter(|role| *role == Role::Holdout).count();
        assert_eq!([0, 1, 2, 5, 41].map(held_out), [0, 0, 1, 1, 9]);
        let many: Vec<usize> = (0..60).filter(|count| held_of(*count).is_some()).collect();
        assert_eq!(many, (42..60).collect::<Vec<_>>());
    }

    #[test]
    fn the_recent_runs_come_alone_then_with_a_sample_of_all_before_and_then_all() {
        let runs: Vec<FoundRun> =
            (0..28).flat_map(|day| (0..4).map(move |k| run(day, k))).collect();
        let bounds = Bounds { runs: 20, ..Bounds::default() };
        let choices = choices(&runs, &bounds);
        assert_eq!(choices.len(), 3);
        assert_eq!(choices[0].len(), 9, "those of 2 days, to the second");
        assert_eq!(choices[1].len(), 20);
        let days: BTreeSet<&str> =
            choices[1].iter().map(|run| run.name.split('/').next().unwrap()).collect();
        assert!(days.len() >= 12, "over the weeks: {days:?}");
        assert!(choices[1].windows(2).all(|pair| pair[0].recorded <= pair[1].recorded));
        assert_eq!(choices[2].len(), 28 * 4);
        assert_eq!(super::choices(&runs[100..], &bounds).len(), 1 + 1);
        assert_eq!(super::choices(&runs[106..], &bounds).len(), 1, "no older ones");
        assert!(super::choices(&[], &bounds).is_empty());
    }
}
