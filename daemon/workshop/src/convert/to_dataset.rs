//! Conversion of a recording to a dataset.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use dynocar::cli::Failure;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{OutputError, require_new, write_file};
use dynocar::storage::{Disk, Storage, folder_of};
use dynocar_analysis::dataset::keys::{self, run};
use dynocar_analysis::dataset::written::TomlText;
use dynocar_analysis::dataset::{
    Dataset, DatasetHead, FileEntry, MANIFEST_FILE, Manifest, Quantity, Role,
};
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{SampleField, TrainSample};

use super::{FileContent, RecordedDataset, WHEEL_SLIDE};
use dynocar_mcap::error::{AtPath, ReadError};
use dynocar_mcap::recording::Recording;

/// Least number of samples for each restart of their numbering; a recording with fewer is of several controllers.
const RESTARTS_RARE: usize = 20;

/// Files of the train and the line for a recording to which none are attached.
#[derive(Clone, Debug, Default)]
pub struct ModelFiles {
    /// The train's.
    pub train: Option<PathBuf>,
    /// The line's.
    pub track: Option<PathBuf>,
}

/// Why a recording becomes no dataset.
#[derive(Debug, thiserror::Error)]
pub enum ToDatasetError {
    /// The recording, or a file that was given with it, cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file of the dataset cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// It holds another thing than a dataset of one train.
    #[error(transparent)]
    Content(#[from] AtPath<NoDataset>),
}

/// A recording that makes no dataset is wrong input; a dataset that cannot be written is not.
impl From<ToDatasetError> for Failure {
    fn from(error: ToDatasetError) -> Self {
        match error {
            ToDatasetError::Output(error) => error.into(),
            error => Failure::input(error),
        }
    }
}

/// Errors of a recording that is to become a dataset.
#[derive(Debug, thiserror::Error)]
pub enum NoDataset {
    /// It holds several trains.
    #[error("holds trains {trains}; a dataset is of one: choose it by --train")]
    SeveralTrains {
        /// Their numbers.
        trains: String,
    },
    /// It holds another train.
    #[error("expected samples of train {wanted}; those in it are of {trains}")]
    NoSuchTrain {
        /// The train asked for.
        wanted: u64,
        /// Those that there are.
        trains: String,
    },
    /// Nobody names the train.
    #[error(
        "the file of train {train} is not attached: give it to `dynocar convert` by --train-file"
    )]
    NoTrainFile {
        /// The train.
        train: u64,
    },
    /// Another tool has merged samples that several controllers published under one number.
    #[error(
        "the numbers of train {train}'s samples go back and forth: another tool has merged recordings of \
         several controllers; convert each of them by itself"
    )]
    SeveralControllers {
        /// The train.
        train: u64,
    },
    /// An attached file would be written outside the folder.
    #[error("attached file {name:?}: expected a path below the dataset's folder")]
    Outside {
        /// The attached name.
        name: String,
    },
}

/// Summary of the dataset made from a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unpacked {
    /// Runs in it.
    pub runs: usize,
    /// Samples in them.
    pub samples: usize,
    /// Snapshots and events that a dataset has no place for.
    pub left_out: usize,
    /// Where the recording broke off, in words.
    pub broken: Option<String>,
}

/// Writes a recording, of one that rotated its files in order, as a dataset into a new folder.
///
/// # Errors
///
/// See [`ToDatasetError`].
pub fn to_dataset(
    paths: &[PathBuf],
    folder: &Path,
    train: Option<u64>,
    files: &ModelFiles,
) -> Result<Unpacked, ToDatasetError> {
    require_new(folder)?;
    unpack(&paths[0], Recording::of_samples(paths)?, folder, train, files)
}

/// Writes the contents of a recording as a dataset into a new folder; `path` names the recording.
///
/// # Errors
///
/// See [`ToDatasetError`].
pub fn unpack(
    path: &Path,
    recording: Recording,
    folder: &Path,
    train: Option<u64>,
    files: &ModelFiles,
) -> Result<Unpacked, ToDatasetError> {
    let (dataset, unpacked) = dataset_of(path, recording, train, files)?;
    for name in dataset.names() {
        let path = folder.join(name);
        Disk.make_folder(folder_of(&path))
            .map_err(|source| OutputError::File { path: path.clone(), source })?;
        write_file(&path, &dataset.bytes(name).unwrap_or_default())?;
    }
    Ok(unpacked)
}

/// Returns the contents of a recording as a dataset; `path` names the recording.
///
/// # Errors
///
/// See [`ToDatasetError`].
pub fn dataset_of(
    path: &Path,
    recording: Recording,
    train: Option<u64>,
    files: &ModelFiles,
) -> Result<(RecordedDataset, Unpacked), ToDatasetError> {
    let refused = |problem| ToDatasetError::from(AtPath::<NoDataset>::of(path)(problem));
    let train = chosen(&recording, train).map_err(refused)?;
    let mut unpacked = Unpacked {
        samples: recording.samples.len(),
        left_out: recording.left_out + recording.snapshots.len() + recording.events.len(),
        broken: recording.broken.clone(),
        ..Unpacked::default()
    };
    let mut dataset = RecordedDataset::new(path);
    let mut declared = None;
    if recording.attached_dataset().any(|(name, _)| name == MANIFEST_FILE) {
        for (name, content) in recording.attached_dataset() {
            if !is_below(name) {
                return Err(refused(NoDataset::Outside { name: name.into() }));
            }
            unpacked.runs += usize::from(!name.ends_with(".toml"));
            dataset.put(name, FileContent::Bytes(content.clone()));
        }
        let head = DatasetHead::open(&dataset);
        // Its reader reports its faults.
        let read = head.clone().and_then(|it| it.read(&dataset));
        if read.map_or(true, |it| are_of(&it, &recording.samples)) {
            return Ok((dataset, unpacked));
        }
        declared = head.ok().and_then(|it| read_models(&dataset, &it.manifest));
    }
    let (train_text, track_text) = match declared {
        Some(models) if files.train.is_none() => models,
        _ => models(path, &recording, train, files)?,
    };
    dataset.put(TRAIN_FILE, FileContent::Bytes(train_text));
    let has_track = track_text.is_some();
    if let Some(text) = track_text {
        dataset.put(TRACK_FILE, FileContent::Bytes(text));
    }
    let samples: Vec<TrainSample> =
        recording.samples.into_iter().filter(|it| it.train_id == train).collect();
    let restarts = samples.windows(2).filter(|it| it[1].sequence <= it[0].sequence).count();
    if restarts * RESTARTS_RARE > samples.len() {
        return Err(refused(NoDataset::SeveralControllers { train }));
    }
    let runs: Vec<&[TrainSample]> = samples
        .chunk_by(|one, next| (one.run, one.direction) == (next.run, next.direction))
        .collect();
    let manifest = manifest(path, &runs, &samples, has_track);
    dataset.put(MANIFEST_FILE, FileContent::Bytes(manifest.into_bytes()));
    for (index, run) in runs.iter().enumerate() {
        dataset.put(&run_file(index), FileContent::Samples(run.to_vec()));
    }
    (unpacked.runs, unpacked.samples) = (runs.len(), samples.len());
    Ok((dataset, unpacked))
}

/// Returns whether a recording's samples are those of the dataset that is attached to it, all and no other: another
/// tool may have cut or changed its messages.
fn are_of(dataset: &Dataset, samples: &[TrainSample]) -> bool {
    let attached: usize = dataset.runs.iter().map(|run| run.samples.len()).sum();
    let published = dataset.runs.iter().flat_map(|run| &run.samples);
    let is_same = |(one, other): (&TrainSample, &TrainSample)| {
        let fields = |it: &TrainSample| SampleField::ALL.map(|field| it.get(field));
        (one.time_ns, one.direction, fields(one)) == (other.time_ns, other.direction, fields(other))
    };
    attached == samples.len() && published.zip(samples).all(is_same)
}

/// Returns the files of train and line of a dataset that is attached.
fn read_models(dataset: &RecordedDataset, manifest: &Manifest) -> Option<Models> {
    let read = |it: &FileEntry| dataset.bytes(&it.path).map(Cow::into_owned);
    Some((read(&manifest.train_file)?, manifest.track_file.as_ref().and_then(read)))
}

fn chosen(recording: &Recording, train: Option<u64>) -> Result<u64, NoDataset> {
    let all = recording.trains();
    let trains = all.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    match (train, all.as_slice()) {
        (Some(wanted), all) if all.contains(&wanted) => Ok(wanted),
        (Some(wanted), _) => Err(NoDataset::NoSuchTrain { wanted, trains }),
        (None, [only]) => Ok(*only),
        (None, _) => Err(NoDataset::SeveralTrains { trains }),
    }
}

/// Texts of the train and, where there is one, the line.
type Models = (Vec<u8>, Option<Vec<u8>>);

/// Returns the given models, else those of the newest attached configuration of the train.
fn models(
    path: &Path,
    recording: &Recording,
    train: u64,
    files: &ModelFiles,
) -> Result<Models, ToDatasetError> {
    let read = |path: &PathBuf| std::fs::read(path).map_err(ReadError::of(path));
    let attached = |name: String| {
        let end = format!("/{name}");
        let found = recording.attachments.iter().rev().find(|it| it.0.ends_with(&end));
        found.map(|it| it.1.clone())
    };
    let (train_text, is_given) = match &files.train {
        Some(file) => (read(file)?, true),
        None => {
            let found = attached(format!("train-{train}.toml"));
            let missing = || AtPath::<NoDataset>::of(path)(NoDataset::NoTrainFile { train });
            (found.ok_or_else(missing)?, false)
        }
    };
    let track_text = match &files.track {
        Some(file) => Some(read(file)?),
        None if is_given => None,
        None => attached(format!("track-{train}.toml")),
    };
    Ok((train_text, track_text))
}

fn is_below(name: &str) -> bool {
    !name.is_empty() && Path::new(name).components().all(|it| matches!(it, Component::Normal(_)))
}

fn run_file(index: usize) -> String {
    format!("runs/{:03}.csv", index + 1)
}

fn manifest(
    path: &Path,
    runs: &[&[TrainSample]],
    samples: &[TrainSample],
    has_track: bool,
) -> String {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let named = |name: &str| format!("\"{name}\"");
    let mut text = TomlText::new("", keys::dataset::TABLE);
    text.value(&keys::dataset::NAME, toml::Value::String(name.into_owned()));
    text.lines("\n");
    text.table(keys::train_file::TABLE);
    text.value(&keys::train_file::FILE, named(TRAIN_FILE));
    if has_track {
        text.lines("\n");
        text.table(keys::track_file::TABLE);
        text.value(&keys::track_file::FILE, named(TRACK_FILE));
    }
    text.lines("\n");
    text.table(keys::column::TABLE);
    text.plain_column(Quantity::Time, "time_ns", "ns");
    let mut column = |quantity: Quantity, column: &str| {
        text.plain_column(quantity, column, quantity.unit().name());
    };
    for field in SampleField::ALL {
        let Some(quantity) = Quantity::of_field(field) else { continue };
        let is_there = samples.iter().any(|it| it.valid & field.bit() != 0);
        if is_there || quantity == Quantity::Speed {
            column(quantity, field.name());
        }
    }
    if samples.iter().any(|it| it.flags & FLAG_WHEEL_SLIDE != 0) {
        column(Quantity::WheelSlide, WHEEL_SLIDE);
    }
    for (index, samples) in runs.iter().enumerate() {
        let is_held_out = runs.len() > 1 && index + 1 == runs.len();
        let role = if is_held_out { Role::Holdout } else { Role::Fit };
        text.lines("\n");
        text.next_table(run::TABLE);
        text.value(&run::FILE, named(&run_file(index)));
        text.value(&run::ROLE, named(role.name()));
        text.value(&run::DIRECTION, if samples[0].direction < 0 { -1 } else { 1 });
    }
    text.into_text()
}
