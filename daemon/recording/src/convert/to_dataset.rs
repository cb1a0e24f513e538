//! A recording to a dataset.

use std::path::{Component, Path, PathBuf};

use dynocar::dataset;
use dynocar::output::{OutputError, require_new, write_file};
use dynocar::storage::{Disk, Storage, folder_of};
use dynocar_analysis::dataset::{Dataset, FileEntry, MANIFEST_FILE, Quantity};
use dynocar_shared::sample::FLAG_WHEEL_SLIDE;
use dynocar_shared::{SampleField, TrainSample};

use super::DATASET_FOLDER;
use super::rows::{WHEEL_SLIDE, to_rows};
use crate::error::{AtPath, ReadError};
use crate::recording::Recording;

/// Samples for each time that the numbers begin anew, at least: below it they are of several controllers.
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
    /// It, or a file that was given beside it, cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file of the dataset cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// It holds another thing than a dataset of one train.
    #[error(transparent)]
    Content(#[from] AtPath<NoDataset>),
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
    #[error("expected samples of train {wanted}, found trains {trains}")]
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
    /// Another tool has merged what several controllers published under one number.
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
    /// Runs that were written.
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
    unpack(&paths[0], Recording::load_all(paths)?, folder, train, files)
}

/// Writes what a recording holds as a dataset into a new folder; `path` names it.
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
    let train = chosen(&recording, train).map_err(AtPath::<NoDataset>::of(path))?;
    let attached: Vec<(&str, &Vec<u8>)> = recording
        .attachments
        .iter()
        .filter_map(|(name, content)| Some((name.strip_prefix(DATASET_FOLDER)?, content)))
        .collect();
    let mut unpacked = Unpacked {
        left_out: recording.snapshots.len() + recording.events.len(),
        broken: recording.broken.clone(),
        ..Unpacked::default()
    };
    if attached.iter().any(|(name, _)| *name == MANIFEST_FILE) {
        for (name, content) in attached {
            if !is_below(name) {
                let outside = NoDataset::Outside { name: name.into() };
                return Err(AtPath::<NoDataset>::of(path)(outside).into());
            }
            unpacked.runs += usize::from(!name.ends_with(".toml"));
            write(folder, name, content)?;
        }
        unpacked.samples = recording.samples.len();
        // Its reader reports its faults.
        if dataset::load(folder).map_or(true, |it| are_of(&it, &recording.samples)) {
            return Ok(unpacked);
        }
    }
    let (train_text, track_text) = match read_models(folder) {
        Some(models) if files.train.is_none() => models,
        _ => models(path, &recording, train, files)?,
    };
    write(folder, "train.toml", &train_text)?;
    if let Some(text) = &track_text {
        write(folder, "track.toml", text)?;
    }
    let samples: Vec<TrainSample> =
        recording.samples.into_iter().filter(|it| it.train_id == train).collect();
    let restarts = samples.windows(2).filter(|it| it[1].sequence <= it[0].sequence).count();
    if restarts * RESTARTS_RARE > samples.len() {
        return Err(AtPath::<NoDataset>::of(path)(NoDataset::SeveralControllers { train }).into());
    }
    let runs: Vec<&[TrainSample]> = samples
        .chunk_by(|one, next| (one.run, one.direction) == (next.run, next.direction))
        .collect();
    let manifest = manifest(path, &runs, &samples, track_text.is_some());
    write(folder, MANIFEST_FILE, manifest.as_bytes())?;
    for (index, run) in runs.iter().enumerate() {
        write(folder, &run_file(index), to_rows(*run).as_bytes())?;
    }
    (unpacked.runs, unpacked.samples) = (runs.len(), samples.len());
    Ok(unpacked)
}

/// True where a recording's samples are those of the dataset that is attached to it, all and no other: another tool may
/// have cut or changed its messages.
fn are_of(dataset: &Dataset, samples: &[TrainSample]) -> bool {
    let attached: usize = dataset.runs.iter().map(|run| run.samples.len()).sum();
    let published = dataset.runs.iter().flat_map(|run| &run.samples);
    let is_same = |(one, other): (&TrainSample, &TrainSample)| {
        let fields = |it: &TrainSample| SampleField::ALL.map(|field| it.get(field));
        (one.time_ns, one.direction, fields(one)) == (other.time_ns, other.direction, fields(other))
    };
    attached == samples.len() && published.zip(samples).all(is_same)
}

/// The files of train and line of a dataset that is attached.
fn read_models(folder: &Path) -> Option<Models> {
    let (files, head) = dataset::open(folder).ok()?;
    let read = |it: &FileEntry| std::fs::read(files.path_of(&it.path)).ok();
    let track = head.manifest.track_file.as_ref().and_then(read);
    Some((read(&head.manifest.train_file)?, track))
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

fn write(folder: &Path, name: &str, content: &[u8]) -> Result<(), OutputError> {
    let path = folder.join(name);
    Disk.make_folder(folder_of(&path))
        .map_err(|source| OutputError::File { path: path.clone(), source })?;
    write_file(&path, content)
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
    let name = toml::Value::String(name.into_owned());
    let mut text = format!("[dataset]\nname = {name}\n\n[train]\nfile = \"train.toml\"\n");
    if has_track {
        text += "\n[track]\nfile = \"track.toml\"\n";
    }
    text += "\n[columns]\ntime = { column = \"time_ns\", unit = \"ns\" }\n";
    let mut column = |quantity: Quantity, column: &str| {
        let unit = quantity.unit().name();
        text += &format!("{quantity} = {{ column = \"{column}\", unit = \"{unit}\" }}\n");
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
    for (index, run) in runs.iter().enumerate() {
        let is_held_out = runs.len() > 1 && index + 1 == runs.len();
        let role = if is_held_out { "holdout" } else { "fit" };
        let direction = if run[0].direction < 0 { -1 } else { 1 };
        text += &format!(
            "\n[[runs]]\nfile = \"{}\"\nrole = \"{role}\"\ndirection = {direction}\n",
            run_file(index)
        );
    }
    text
}
