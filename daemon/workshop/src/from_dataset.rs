//! Conversion of a dataset to a recording.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Component, Path};

use dynocar::cli::Failure;
use dynocar::dataset::{DatasetSource, LoadError};
use dynocar::output::report_line;
use dynocar::storage::{Disk, settle};
use dynocar_analysis::dataset::{Dataset, DatasetFiles, MANIFEST_FILE};
use dynocar_analysis::explain::report::timeline::Timeline;
use dynocar_analysis::identify::published_samples;
use dynocar_mcap::annotate;
use dynocar_mcap::error::WriteError;
use dynocar_mcap::recording::DATASET_FOLDER;
use dynocar_mcap::topic::Message;
use dynocar_mcap::writing::{McapError, RecordingWriter, WallClock};
use dynocar_shared::{TrainId, TrainSample};
use tempfile::TempDir;

use super::convert::{RowError, from_rows, is_rows};
use super::dataset::open;

/// Time in ns between two runs of a dataset in the recording, since the true time is not known.
const BETWEEN_RUNS_NS: i64 = 1_000_000_000;

/// Error of a dataset that cannot become a recording.
#[derive(Debug, thiserror::Error)]
pub enum FromDatasetError {
    /// It cannot be read.
    #[error(transparent)]
    Dataset(#[from] LoadError),
    /// A run that was made of a recording cannot be read.
    #[error(transparent)]
    Rows(#[from] RowError),
    /// A file lies elsewhere, so that it would not come back to its place.
    #[error("{label}: names {file:?}: expected a path below the dataset's folder")]
    Outside {
        /// The manifest.
        label: String,
        /// The path.
        file: String,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// A dataset that makes no recording is wrong input; a recording that cannot be written is not.
impl From<FromDatasetError> for Failure {
    fn from(error: FromDatasetError) -> Self {
        match error {
            FromDatasetError::Dataset(error) => error.into(),
            FromDatasetError::Write(_) => Failure::work(error),
            error => Failure::input(error),
        }
    }
}

/// Writes a dataset as a new recording; gives the number of samples.
///
/// # Errors
///
/// See [`FromDatasetError`].
pub fn from_dataset(folder: &Path, path: &Path) -> Result<usize, FromDatasetError> {
    let (files, head) = open(folder)?;
    let manifest = &head.manifest;
    let mut names = vec![MANIFEST_FILE.to_owned(), manifest.train_file.path.clone()];
    names.extend(manifest.track_file.iter().map(|it| it.path.clone()));
    names.extend(manifest.runs.iter().map(|it| it.file.clone()));
    let is_plain = |it: Component| matches!(it, Component::Normal(_));
    if let Some(file) = names.iter().find(|it| !Path::new(it).components().all(is_plain)) {
        let (label, file) = (files.label(MANIFEST_FILE), file.clone());
        return Err(FromDatasetError::Outside { label, file });
    }
    let dataset = head.read(&files).map_err(LoadError::from)?;
    // They were read a moment ago.
    let contents: Vec<(String, Vec<u8>)> =
        names.into_iter().map(|name| (name.clone(), files.bytes(&name).into_owned())).collect();
    let samples = samples(&dataset, &contents)?;
    write(path, &contents, &samples).map_err(WriteError::of(path))?;
    Ok(samples.len())
}

/// Returns the samples of runs that were made of a recording; else those that a controller would publish.
fn samples(
    dataset: &Dataset,
    contents: &[(String, Vec<u8>)],
) -> Result<Vec<TrainSample>, FromDatasetError> {
    let runs = &contents[contents.len() - dataset.runs.len()..];
    let mut samples = Vec::new();
    for (file, content) in runs {
        let Some(text) = std::str::from_utf8(content).ok().filter(|it| is_rows(it)) else {
            return Ok(published_samples(dataset, TrainId(1)));
        };
        samples.extend(from_rows(file, text)?);
    }
    Ok(samples)
}

fn write(
    path: &Path,
    contents: &[(String, Vec<u8>)],
    samples: &[TrainSample],
) -> Result<(), McapError> {
    let file = BufWriter::new(File::create_new(path)?);
    let mut writer = RecordingWriter::new(file, WallClock::of_another_host())?;
    for (name, content) in contents {
        writer.attach(&format!("{DATASET_FOLDER}{name}"), content, 0)?;
    }
    let (mut offset_ns, mut newest_ns) = (0, 0);
    let mut run = None;
    for sample in samples {
        if run.is_some_and(|run| run != sample.run) && sample.published_ns == 0 {
            offset_ns = newest_ns + BETWEEN_RUNS_NS - sample.time_ns;
        }
        run = Some(sample.run);
        let at_ns = match sample.published_ns {
            0 => sample.time_ns.saturating_add(offset_ns),
            published_ns => published_ns,
        };
        newest_ns = at_ns.max(newest_ns);
        writer.log_next_at(u64::try_from(at_ns).unwrap_or(0));
        writer.write(Message::Sample(sample))?;
    }
    writer.finish()?.into_inner().map_err(|error| error.into_error())?;
    Ok(settle(&Disk, path)?)
}

/// Copies a recording, or the dataset at a path as one, into a new file with an explanation of it.
///
/// # Errors
///
/// A recording that cannot be read is an input failure.
pub fn annotate(from: DatasetSource, timeline: &Timeline, to: &Path) -> Result<(), Failure> {
    let DatasetSource { path, train } = from;
    let train = train.map(|it| it.0);
    let added = if path.is_dir() || path.extension().is_some_and(|it| it == "toml") {
        let folder = TempDir::with_prefix("dynocar-").map_err(Failure::work)?;
        let recording = folder.path().join("dataset.mcap");
        from_dataset(path, &recording)?;
        annotate::annotate(&recording, train, timeline, to)?
    } else {
        annotate::annotate(path, train, timeline, to)?
    };
    report_line(&format!(
        "annotated recording: {}: {} intervals in which an effect acts, {} messages in all",
        to.display(),
        added.effects,
        added.messages
    ));
    Ok(())
}
