//! Recorded runs of one train on one line, read from texts.
//!
//! A dataset is a folder with a `dataset.toml`, which states the quantities and units of the columns in the runs' CSV
//! files, a `train.toml` and, where the line is known, a `track.toml`. Everything particular to the files ends here:
//! the library returns the same [`TrainSample`](dynocar_shared::TrainSample)s that a controller would publish, in SI
//! units, and an account of the data's quality.
//!
//! The texts come in through [`DatasetFiles`]; this library opens no file.
//!
//! # Layout, in the order of reading
//!
//! - [`node`], [`document`], `names`, [`error`]: keys and values with their lines; errors with the allowed values
//! - [`keys`]: every key of the three TOML files, for readers and writers
//! - [`manifest`], [`train_file`], [`track_file`]: the three TOML files
//! - [`quantity`]: quantities of columns, in their [`units`](dynocar_model::units)
//! - [`text_layout`], [`clock`]: the division of text into cells, and times that are no numbers
//! - [`formats`], [`format`](mod@format): the formats of recorded runs; contents of a run's file, text or columns
//! - `lines`, `header`, `cell`, `table`: a CSV file as columns of numbers
//! - [`trains`]: files that hold several trains
//! - `clock_faults`: times with an hour of summer time, seconds without a fraction, rows in another order
//! - [`chainage`], `fill_values`: positions that leap, and numbers in the place of missing values
//! - `order`, `speed_and_position`, `forces`, `altitude`: from columns to time, speed, position, forces and gradient
//! - `resolved`, [`run`], [`quality`], [`diagnostic`], [`dataset_diagnostic`], `diagnosing`: samples,
//!   counts and warnings
//! - [`written`]: writers of the three TOML files, and of changes in declared ones
//! - [`guess`]: a description of files that nobody has described yet

mod altitude;
mod cell;
pub mod chainage;
pub mod clock;
mod clock_faults;
mod column_faults;
mod corrections;
pub mod dataset_diagnostic;
mod diagnosing;
pub mod diagnostic;
pub mod document;
pub mod error;
mod fill_values;
mod force_faults;
mod forces;
pub mod format;
pub mod formats;
pub mod guess;
pub mod keys;
mod lines;
pub mod manifest;
pub mod node;
mod order;
mod position_faults;
pub mod quality;
pub mod quantity;
mod resolved;
pub mod run;
mod speed_and_position;
mod table;
pub mod text_layout;
pub mod track_file;
pub mod train_file;
pub mod trains;
pub mod written;

#[cfg(test)]
mod tests;

pub use clock::TimeFormat;
pub use dataset_diagnostic::DatasetDiagnostic;
pub use diagnosing::FORCE_NOT_RECORDED;
pub use diagnostic::{Diagnostic, unusual_resistance};
pub use document::top_keys;
pub use error::{DatasetError, FileProblem, SourcePosition};
pub use forces::{ForceSource, is_stamped_late, stamped_late};
pub use format::{RunColumn, RunColumns, RunContent, TrainColumn};
pub use manifest::{ColumnMapping, FileEntry, Manifest, PositionReference, Role, RunEntry};
pub use order::OrderCounts;
pub use quality::{Phases, RunQuality};
pub use quantity::Quantity;
pub use resolved::{DATASET_TRAIN, GradientSource};
pub use run::{EXTRAS, QuantitySeries, Run, recorded_unix_s};
pub use speed_and_position::PositionSource;
pub use table::LineCounts;
pub use text_layout::TextLayout;
pub use track_file::parse_track;
pub use train_file::parse_train;

use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::{PowerTrain, TrainModel};
#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// Name of the file that makes a folder a dataset.
pub const MANIFEST_FILE: &str = "dataset.toml";

/// Where the texts of a dataset come from. Paths are as the dataset writes them, from its
/// folder.
pub trait DatasetFiles: Sync {
    /// Returns the text of a file.
    ///
    /// # Errors
    ///
    /// When it cannot be had.
    fn read(&self, path: &str) -> Result<String, FileProblem>;

    /// Reads the contents of a run's file, of which the columns that the manifest maps are used.
    ///
    /// # Errors
    ///
    /// When it cannot be had.
    fn read_run(&self, path: &str, _manifest: &Manifest) -> Result<RunContent, FileProblem> {
        self.read(path).map(RunContent::Text)
    }

    /// Returns the file's name in messages.
    fn label(&self, path: &str) -> String {
        path.into()
    }
}

/// A dataset held in memory, as (path, text).
impl DatasetFiles for [(&str, &str)] {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        let file = self.iter().find(|(name, _)| *name == path);
        file.map(|(_, text)| (*text).into()).ok_or(FileProblem::Missing)
    }

    fn read_run(&self, path: &str, _manifest: &Manifest) -> Result<RunContent, FileProblem> {
        formats::of_run(path).rows(self.read(path)?).map(RunContent::Text)
    }
}

/// Declarations of a dataset; its runs can be read one by one.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetHead {
    /// The content of `dataset.toml`.
    pub manifest: Manifest,
    /// The train.
    pub train: Arc<TrainModel>,
    /// The line; `None` when it is not known.
    pub track: Option<Arc<Track>>,
}

/// A dataset, read in full.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Its name.
    pub name: String,
    /// Source, licence and the like.
    pub description: Option<String>,
    /// The train.
    pub train: Arc<TrainModel>,
    /// The line; `None` when it is not known.
    pub track: Option<Arc<Track>>,
    /// The runs, in the order of the manifest.
    pub runs: Vec<Run>,
}

impl Dataset {
    /// Returns the usual time in s between two samples, of the run whose samples are furthest apart.
    pub fn step_s(&self) -> f64 {
        self.runs.iter().map(|run| run.quality.order.step_s).fold(0.0, f64::max)
    }

    /// Returns the declarations, without runs.
    pub fn without_runs(&self) -> Dataset {
        Dataset {
            name: self.name.clone(),
            description: self.description.clone(),
            train: self.train.clone(),
            track: self.track.clone(),
            runs: Vec::new(),
        }
    }

    /// Returns the same with forces that act `late_s` before their stamps taken where they act.
    pub fn with_forces_moved(&self, late_s: f64) -> Dataset {
        let mut dataset = self.clone();
        dataset.runs.iter_mut().for_each(|run| run.move_forces(late_s));
        dataset
    }

    /// Returns the same with the forces that come from power taken from another drive.
    pub fn with_drive(&self, drive: PowerTrain) -> Dataset {
        let mut dataset = self.clone();
        let before = self.train.drive.unwrap_or(PowerTrain::USUAL);
        for run in &mut dataset.runs {
            run.retake_forces(before, drive);
        }
        dataset.train = Arc::new(TrainModel { drive: Some(drive), ..(*self.train).clone() });
        dataset
    }

    /// Returns whether forces come from power and nobody declares how much of it reaches the rims.
    pub fn is_efficiency_unknown(&self) -> bool {
        let by_power = |run: &Run| run.traction_source == ForceSource::Power;
        self.train.drive.is_none() && self.runs.iter().any(by_power)
    }

    /// [`Run::keep_traction_only`] of all runs.
    pub fn keep_traction_only(&mut self) {
        self.runs.iter_mut().for_each(Run::keep_traction_only);
    }
}

impl DatasetHead {
    /// Reads `dataset.toml`, the train and the line, but no run.
    ///
    /// # Errors
    ///
    /// The first mistake, with file, line and choices.
    pub fn open(files: &(impl DatasetFiles + ?Sized)) -> Result<Self, DatasetError> {
        let label = files.label(MANIFEST_FILE);
        let manifest = Manifest::parse(&label, &text(files, MANIFEST_FILE, None)?)?;
        let FileEntry { path, place } = &manifest.train_file;
        let train = parse_train(&files.label(path), &text(files, path, Some(place))?)?;
        let track = match &manifest.track_file {
            Some(FileEntry { path, place }) => {
                Some(Arc::new(parse_track(&files.label(path), &text(files, path, Some(place))?)?))
            }
            None => None,
        };
        require_curves(&manifest, &train)?;
        Ok(DatasetHead { manifest, train: Arc::new(train), track })
    }

    /// Returns the dataset without its runs.
    pub fn without_runs(&self) -> Dataset {
        let Manifest { name, description, .. } = &self.manifest;
        Dataset {
            name: name.clone(),
            description: description.clone(),
            train: self.train.clone(),
            track: self.track.clone(),
            runs: Vec::new(),
        }
    }

    /// Reads all runs.
    ///
    /// # Errors
    ///
    /// The first mistake in one of their files, with line and column.
    pub fn read(&self, files: &(impl DatasetFiles + ?Sized)) -> Result<Dataset, DatasetError> {
        // The first mistake is that of the first run in the manifest, in any order of reading.
        let runs = self.read_each(files).into_iter().collect::<Result<_, _>>()?;
        Ok(Dataset { runs, ..self.without_runs() })
    }

    /// Reads all runs, in the order of the manifest, each or the first mistake in its file.
    fn read_each(&self, files: &(impl DatasetFiles + ?Sized)) -> Vec<Result<Run, DatasetError>> {
        let places = 0..self.manifest.runs.len();
        #[cfg(feature = "parallel")]
        let places = places.into_par_iter();
        places.map(|index| self.read_run(files, index)).collect()
    }

    /// Reads one run by its place in the manifest, from 0.
    ///
    /// # Errors
    ///
    /// The first mistake in its file, with line and column.
    ///
    /// # Panics
    ///
    /// When there is no such run.
    pub fn read_run(
        &self,
        files: &(impl DatasetFiles + ?Sized),
        index: usize,
    ) -> Result<Run, DatasetError> {
        let entry = &self.manifest.runs[index];
        let context = resolved::Context {
            manifest: &self.manifest,
            train: &self.train,
            track: self.track.as_ref(),
        };
        let content = files
            .read_run(&entry.file, &self.manifest)
            .map_err(|problem| unread(files.label(&entry.file), problem, Some(&entry.place)))?;
        run::read(context, index as u32 + 1, entry, &files.label(&entry.file), content)
    }
}

impl Dataset {
    /// Reads a dataset with all its runs.
    ///
    /// # Errors
    ///
    /// The first mistake, with file, line and choices.
    pub fn load(files: &(impl DatasetFiles + ?Sized)) -> Result<Self, DatasetError> {
        DatasetHead::open(files)?.read(files)
    }

    /// Returns the runs with a role.
    pub fn with_role(&self, role: Role) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.role == role)
    }
}

/// Returns the text of a file; `listed_at` is where the dataset names it.
fn text(
    files: &(impl DatasetFiles + ?Sized),
    path: &str,
    listed_at: Option<&SourcePosition>,
) -> Result<String, DatasetError> {
    files.read(path).map_err(|problem| unread(files.label(path), problem, listed_at))
}

fn unread(file: String, problem: FileProblem, listed_at: Option<&SourcePosition>) -> DatasetError {
    use FileProblem::{NotText, NotUtf8, OtherEncoding, Table};
    let is_there = matches!(problem, NotUtf8 { .. } | OtherEncoding { .. } | NotText(_) | Table(_));
    match listed_at {
        Some(place) if !is_there => place.clone().problem(format!("{file}: {problem}")),
        _ => problem.of(&file),
    }
}

/// Handles are shares of a curve, which must then be declared.
fn require_curves(manifest: &Manifest, train: &TrainModel) -> Result<(), DatasetError> {
    let cases = [
        (Quantity::TractionHandle, Quantity::TractionForce, &train.traction, "[traction] effort"),
        (
            Quantity::BrakeHandle,
            Quantity::BrakeForce,
            &train.brake,
            "[brake] max_force_kn or effort",
        ),
    ];
    for (handle, force, curve, key) in cases {
        if let (Some(mapping), None, None) =
            (manifest.mapping(handle), manifest.mapping(force), curve)
        {
            let train_file = &manifest.train_file.path;
            let words =
                format!("{handle} is a share of the effort curve, but {train_file} has no {key}");
            return Err(mapping.place.clone().problem(words));
        }
    }
    Ok(())
}
