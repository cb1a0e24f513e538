//! Runs that are explained together, within bounds of memory and time: a dataset with the train and line of the model
//! in force.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use dynocar::dataset::LoadError;
use dynocar::models::ModelText;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar_analysis::dataset::written::name_model;
use dynocar_analysis::dataset::{
    Dataset, DatasetFiles, DatasetHead, FileProblem, MANIFEST_FILE, Manifest, Role, Run, RunContent,
};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use toml::Table;

use super::available_runs::{FoundRun, report_unusable};
use super::memory::LearnerMemory;
use crate::dataset::FilesOfDataset;

/// Bounds of the runs that are explained together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Greatest number of runs.
    pub runs: usize,
    /// Greatest total time of the runs.
    pub time: Duration,
    /// Greatest number of their samples, which bounds the memory.
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
    /// The runs as one dataset.
    pub dataset: Dataset,
    /// Where they lie, in the same order.
    pub runs: Vec<FoundRun>,
}

/// Returns the choices of runs that are explained, one after the other until one shows an effect: the recent ones, in
/// which something new shows undiluted, then these with a sample of all before.
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
    choices
}

/// Returns at most `most` places of a list, evenly spread over it.
fn spread(length: usize, most: usize) -> BTreeSet<usize> {
    let count = length.min(most);
    (0..count).map(|k| (2 * k + 1) * length / (2 * count)).collect()
}

/// A declared model, as text and as read.
pub struct Declared<'d> {
    /// Its files.
    pub text: &'d ModelText,
    /// The train.
    pub train: &'d Arc<TrainModel>,
    /// The line, where one is declared.
    pub track: Option<&'d Arc<Track>>,
}

/// Reads runs under a model, the newest first until the bounds are reached; unreadable runs are reported once and left
/// out. `None` where fewer than two are left: one to fit, one to judge.
pub fn read(
    chosen: &[FoundRun],
    declared: Declared<'_>,
    bounds: &Bounds,
    memory: &mut LearnerMemory,
) -> Option<Pool> {
    let Declared { text, train, track } = declared;
    let mut kept: Vec<(FoundRun, Run)> = Vec::new();
    let (mut time_s, mut samples) = (0.0, 0);
    let mut opened = None;
    for found in chosen.iter().rev() {
        if memory.unusable.contains_key(&found.key()) {
            continue;
        }
        let run = match read_run(found, text, &mut opened) {
            Ok(run) => run,
            Err(problem) => {
                report_unusable(memory, &found.key(), &problem);
                continue;
            }
        };
        time_s += duration_s(&run);
        samples += run.samples.len();
        let is_within = time_s <= bounds.time.as_secs_f64() && samples <= bounds.samples;
        if !is_within && kept.len() > 1 {
            break;
        }
        kept.push((found.clone(), run));
    }
    kept.reverse();
    let (found, runs) = kept.into_iter().unzip();
    let dataset = Dataset {
        name: format!("train {}", train.name),
        description: None,
        train: Arc::clone(train),
        track: track.map(Arc::clone),
        runs,
    };
    Pool { dataset, runs: found }.in_order()
}

impl Pool {
    /// Returns the pool with its runs numbered, the last ones held out; `None` where fewer than two are left.
    pub fn in_order(mut self) -> Option<Self> {
        let count = self.runs.len();
        if count < 2 {
            return None;
        }
        let held_out = ((HELD_OUT_SHARE * count as f64).ceil() as usize).min(count - 1);
        for (index, (found, run)) in self.runs.iter().zip(&mut self.dataset.runs).enumerate() {
            run.file.clone_from(&found.name);
            run.role = if index + held_out < count { Role::Fit } else { Role::Holdout };
            run.number = index as u32 + 1;
            run.samples.iter_mut().for_each(|sample| sample.run = run.number);
        }
        Some(self)
    }

    /// Returns the pool without a run; `None` where too few are left.
    pub fn without(mut self, name: &str) -> Option<Self> {
        let index = self.runs.iter().position(|run| run.name == name)?;
        self.runs.remove(index);
        self.dataset.runs.remove(index);
        self.in_order()
    }
}

/// The dataset whose runs are read.
struct OpenedDataset<'m> {
    folder: PathBuf,
    files: Overlay<'m>,
    head: DatasetHead,
}

fn read_run<'m>(
    found: &FoundRun,
    text: &'m ModelText,
    opened: &mut Option<OpenedDataset<'m>>,
) -> Result<Run, String> {
    if opened.as_ref().is_none_or(|it| it.folder != found.dataset) {
        let files = Overlay::at(&found.dataset, text).map_err(|error| error.to_string())?;
        let head = DatasetHead::open(&files).map_err(|error| error.to_string())?;
        *opened = Some(OpenedDataset { folder: found.dataset.clone(), files, head });
    }
    match opened {
        // The description may have changed since the runs were found.
        Some(OpenedDataset { files, head, .. }) if found.index < head.manifest.runs.len() => {
            head.read_run(files, found.index).map_err(|error| error.to_string())
        }
        _ => Err(format!("{}: no longer described", found.name)),
    }
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
    fn the_recent_runs_come_alone_first_and_then_with_a_sample_of_all_before() {
        let runs: Vec<FoundRun> =
            (0..28).flat_map(|day| (0..4).map(move |k| run(day, k))).collect();
        let bounds = Bounds { runs: 20, ..Bounds::default() };
        let choices = choices(&runs, &bounds);
        assert_eq!(choices.len(), 2);
        assert_eq!(choices[0].len(), 9, "those of 2 days, to the second");
        assert_eq!(choices[1].len(), 20);
        let days: BTreeSet<&str> =
            choices[1].iter().map(|run| run.name.split('/').next().unwrap()).collect();
        assert!(days.len() >= 12, "over the weeks: {days:?}");
        assert!(choices[1].windows(2).all(|pair| pair[0].recorded <= pair[1].recorded));
        assert_eq!(super::choices(&runs[100..], &bounds).len(), 1 + 1);
        assert_eq!(super::choices(&runs[106..], &bounds).len(), 1, "no older ones");
        assert!(super::choices(&[], &bounds).is_empty());
    }
}
