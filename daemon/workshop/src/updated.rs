//! The updated model as files: a train and a line that the daemon loads, and a dataset of the two and of the declared
//! runs.
//!
//! The declared files are copied with all of their keys, and only values that the data changed are replaced: always a,
//! b, c, and the keys of the effects that were found: a constant, a profile, a correction. A line's file is made where
//! none was declared and an effect needs one. An effect of certain runs is an event and not a property of a train or a
//! line: it is listed, so that nobody expects it in the files.

use std::path::{Path, PathBuf};

use dynocar::dataset::{DatasetSource, LoadError, read_text};
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};
use dynocar::output::{OutputError, require_new, write_in_folder};
use dynocar_analysis::dataset::written::{
    alignment_files, can_hold, name_model, run_files, set, write_entry,
};
use dynocar_analysis::dataset::{DatasetFiles, FileProblem, MANIFEST_FILE};
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::evidence::Fit;
use dynocar_model::train::numbers::{AUXILIARY_POWER, DAVIS_A, DAVIS_B, DAVIS_C, DRIVE_EFFICIENCY};
use toml::Table;

use super::dataset::{FilesOfDataset, from_folder, open};

/// The files of an updated model: the train, the line where something is known of it, and the dataset.
pub const UPDATED_FILES: [&str; 3] = [TRAIN_FILE, TRACK_FILE, MANIFEST_FILE];

/// Written files.
#[derive(Clone, Debug, PartialEq)]
pub struct UpdatedFiles {
    /// The files of the model and its dataset.
    pub files: Vec<PathBuf>,
    /// Kinds of effects that the formats cannot express.
    pub not_expressed: Vec<String>,
}

/// Writes the updated model of a dataset into a folder as a dataset that can be explained again:
/// `train.toml`, `track.toml` where something is known of the line, and a `dataset.toml` that names
/// both and the runs where they lie. The runs of a recording are written next to it.
///
/// # Errors
///
/// When the declared files cannot be read or the grown ones not written.
pub fn write_updated<'s>(
    dataset: impl Into<DatasetSource<'s>>,
    explanation: &Explanation,
    folder: &Path,
) -> Result<UpdatedFiles, UpdatedModelError> {
    let dataset = dataset.into();
    let (source, head) = open(dataset)?;
    let read = |path: &str| {
        source.read(path).map_err(|problem: FileProblem| UpdatedModelError::Declared {
            label: source.label(path),
            problem: problem.to_string(),
        })
    };
    let (train, track) = (&head.manifest.train_file, head.manifest.track_file.as_ref());
    let texts = (read(&train.path)?, track.map(|file| read(&file.path)).transpose()?);
    let labels = (&train.path[..], track.map_or(TRACK_FILE, |file| &file.path));
    let declared = (&texts.0[..], texts.1.as_deref());
    let mut grown = UpdatedTables::new(explanation, declared, labels)?;
    if let (Some(declared), Some(track)) = (track, &mut grown.track) {
        keep_alignments(track, &source.path_of(&declared.path), folder);
    }
    let mut manifest = table(&read(MANIFEST_FILE)?, &source.label(MANIFEST_FILE))?;
    keep_runs(&mut manifest, &source, folder)?;
    name_model(&mut manifest, TRAIN_FILE, grown.track.as_ref().map(|_| TRACK_FILE));
    let texts = grown.texts(explanation, labels, MANIFEST_FILE);
    let dataset =
        updated_text(explanation, MANIFEST_FILE, &dataset.path.display().to_string(), &manifest);
    if texts.track.is_none() {
        forget(&folder.join(TRACK_FILE))?;
    }
    let all = [Some(texts.train), texts.track, Some(dataset)];
    let named = UPDATED_FILES.into_iter().zip(all).filter_map(|(name, text)| Some((name, text?)));
    let files = named.map(|(name, text)| write_in_folder(folder, name, &text));
    Ok(UpdatedFiles { files: files.collect::<Result<_, _>>()?, not_expressed: texts.not_expressed })
}

/// An updated model as texts.
#[derive(Clone, Debug, PartialEq)]
pub struct UpdatedTexts {
    /// Of the train.
    pub train: String,
    /// Of the line, where something is known of it.
    pub track: Option<String>,
    /// Kinds of effects that the formats cannot express.
    pub not_expressed: Vec<String>,
}

/// Returns the texts of a model that grew from declared ones of a train and a line; `labels` and `source` name these in
/// the first lines.
///
/// # Errors
///
/// When a declared text is no TOML.
pub fn updated_texts(
    explanation: &Explanation,
    (train, track): (&str, Option<&str>),
    labels: (&str, &str),
    source: &str,
) -> Result<UpdatedTexts, UpdatedModelError> {
    Ok(UpdatedTables::new(explanation, (train, track), labels)?.texts(explanation, labels, source))
}

/// An updated model as tables.
struct UpdatedTables {
    train: Table,
    track: Option<Table>,
    not_expressed: Vec<String>,
}

impl UpdatedTables {
    fn new(
        explanation: &Explanation,
        (train, track): (&str, Option<&str>),
        labels: (&str, &str),
    ) -> Result<Self, UpdatedModelError> {
        let mut train = table(train, labels.0)?;
        let declared = track.map(|text| table(text, labels.1)).transpose()?;
        let is_declared = declared.is_some();
        let mut track = declared.unwrap_or_default();
        let not_expressed = grow(&explanation.outcome.fit, &mut train, &mut track);
        if let Some(drive) = explanation.answer.drive.as_ref().filter(|it| it.at_bound.is_none()) {
            set(&mut train, &DRIVE_EFFICIENCY, drive.efficiency.value);
            if let Some(known) = drive.auxiliary_power_kw {
                set(&mut train, &AUXILIARY_POWER, known.value);
            }
        }
        let track = (is_declared || !track.is_empty()).then_some(track);
        Ok(UpdatedTables { train, track, not_expressed })
    }

    fn texts(self, explanation: &Explanation, labels: (&str, &str), source: &str) -> UpdatedTexts {
        UpdatedTexts {
            train: updated_text(explanation, labels.0, source, &self.train),
            track: self.track.map(|track| updated_text(explanation, labels.1, source, &track)),
            not_expressed: self.not_expressed,
        }
    }
}

fn updated_text(explanation: &Explanation, label: &str, source: &str, keys: &Table) -> String {
    let statement = &explanation.answer.statement;
    format!("{UPDATED_MARK}{label} of {source} by `dynocar explain`.\n# {statement}\n{keys}")
}

fn table(text: &str, label: &str) -> Result<Table, UpdatedModelError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    text.parse().map_err(|error: toml::de::Error| UpdatedModelError::Declared {
        label: label.into(),
        problem: error.message().to_string(),
    })
}

/// Changes the tables of a declared train and line to those of a fitted model; gives the kinds
/// that they cannot express.
pub fn grow(fit: &Fit, train: &mut Table, track: &mut Table) -> Vec<String> {
    let mut not_expressed = Vec::new();
    for (key, value) in [DAVIS_A, DAVIS_B, DAVIS_C].iter().zip(&fit.theta) {
        set(train, key, *value);
    }
    for (effect, range) in fit.model.effects.iter().zip(fit.model.ranges()) {
        let entries = effect.entries(&fit.theta[range]);
        let is_held = entries
            .as_ref()
            .is_some_and(|entries| entries.iter().all(|entry| can_hold(entry, train, track)));
        if !is_held {
            not_expressed.push(effect.kind().to_string());
            continue;
        }
        for entry in entries.into_iter().flatten() {
            write_entry(entry, train, track);
        }
    }
    not_expressed
}

/// Names the runs where they lie; those of a recording are written into the folder.
///
/// # Errors
///
/// When a run cannot be written, or would take the place of another file.
pub fn keep_runs(
    manifest: &mut Table,
    source: &FilesOfDataset,
    folder: &Path,
) -> Result<(), UpdatedModelError> {
    for file in run_files(manifest) {
        if !source.is_recording() {
            *file = seen_from(folder, &source.path_of(file));
            continue;
        }
        let target = folder.join(&*file);
        // Runs have no mark of their own.
        if !is_updated(&folder.join(TRAIN_FILE)) {
            require_new(&target)?;
        }
        let text = source.read(file).map_err(|problem| UpdatedModelError::Declared {
            label: source.label(file),
            problem: problem.to_string(),
        })?;
        let (parent, name) = (target.parent().unwrap_or(folder), target.file_name());
        let name = name.unwrap_or_default().to_string_lossy();
        write_in_folder(parent, &name, &text)?;
    }
    Ok(())
}

/// Names the alignments where they lie, next to the declared line's file.
pub fn keep_alignments(track: &mut Table, declared: &Path, folder: &Path) {
    let beside = declared.parent().unwrap_or(Path::new(""));
    for file in alignment_files(track) {
        *file = seen_from(folder, &beside.join(&*file));
    }
}

/// Removes a file that an earlier explanation wrote and this one does not: the model lacks it.
///
/// # Errors
///
/// When it is there and cannot be removed.
pub fn forget(file: &Path) -> Result<(), OutputError> {
    if !is_updated(file) {
        return Ok(());
    }
    std::fs::remove_file(file).map_err(|source| OutputError::File { path: file.into(), source })
}

fn is_updated(file: &Path) -> bool {
    read_text(file).is_ok_and(|text| text.starts_with(UPDATED_MARK))
}

fn seen_from(folder: &Path, file: &Path) -> String {
    from_folder(folder, file).display().to_string()
}

/// Why the grown files cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum UpdatedModelError {
    /// The dataset cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A declared file is not there any more or is no TOML.
    #[error("{label}: expected a TOML file, got {problem}")]
    Declared {
        /// The file.
        label: String,
        /// Problem of the run.
        problem: String,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// How a grown file begins.
pub const UPDATED_MARK: &str = "# Grown from ";
