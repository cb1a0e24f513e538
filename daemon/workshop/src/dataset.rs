//! The dataset at a path: a folder, or a recording, which becomes a dataset in memory; and a dataset as a recording.

use std::borrow::Cow;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Component, Path, PathBuf};

use dynocar::cli::Failure;
use dynocar::dataset::{DatasetFolder, DatasetSource, LoadError};
use dynocar::output::report_line;
use dynocar::storage::{Disk, settle};
use dynocar::text_file::require_regular;
use dynocar_analysis::dataset::{
    Dataset, DatasetFiles, DatasetHead, FileProblem, MANIFEST_FILE, Manifest, RunContent,
    SourcePosition,
};
use dynocar_analysis::explain::report::timeline::Timeline;
use dynocar_analysis::identify::published_samples;
use dynocar_mcap::annotate;
use dynocar_mcap::error::WriteError;
use dynocar_mcap::recording::DATASET_FOLDER;
use dynocar_mcap::topic::Message;
use dynocar_mcap::writing::{McapError, RecordingWriter, WallClock};
use dynocar_shared::{TrainId, TrainSample};
use tempfile::TempDir;

use super::convert::{ModelFiles, RecordedDataset, RowError, dataset_of, from_rows, is_rows};
use super::formats::{self, RunFile, is_recording};

/// The files of a dataset.
#[derive(Clone, Debug)]
pub enum FilesOfDataset {
    /// In a folder.
    Folder(DatasetFolder),
    /// In a recording.
    Recording(RecordedDataset),
}

impl FilesOfDataset {
    /// Returns those of the dataset at a path: its folder, its `dataset.toml`, or a recording.
    ///
    /// # Errors
    ///
    /// When there is nothing at the path, or no dataset.
    pub fn at<'p>(source: impl Into<DatasetSource<'p>>) -> Result<Self, LoadError> {
        let source = source.into();
        if !is_recording(source.path) {
            return DatasetFolder::at(source).map(FilesOfDataset::Folder);
        }
        let read = || {
            let (paths, train) = ([source.path.to_path_buf()], source.train.map(|it| it.0));
            let recording = (formats::of_recording(&paths).samples)(&paths)?;
            dataset_of(source.path, recording, train, &ModelFiles::default())
                .map_err(|error| error.to_string())
        };
        let refused = |problem| LoadError::Recording { path: source.path.into(), problem };
        let (dataset, unpacked) = read().map_err(refused)?;
        if let Some(broken) = &unpacked.broken {
            report_line(&format!("dynocar: {broken}; `dynocar recover` makes it whole"));
        }
        Ok(FilesOfDataset::Recording(dataset))
    }

    /// Returns true for a recording, which holds all files of the dataset itself.
    pub fn is_recording(&self) -> bool {
        matches!(self, FilesOfDataset::Recording(_))
    }

    /// Returns where a file lies, or would lie.
    pub fn path_of(&self, path: &str) -> PathBuf {
        match self {
            FilesOfDataset::Folder(folder) => folder.path_of(path),
            FilesOfDataset::Recording(dataset) => dataset.label(path).into(),
        }
    }

    /// Returns the bytes of a file; none where there is none.
    pub fn bytes(&self, path: &str) -> Cow<'_, [u8]> {
        match self {
            FilesOfDataset::Folder(it) => {
                std::fs::read(it.path_of(path)).unwrap_or_default().into()
            }
            FilesOfDataset::Recording(dataset) => dataset.bytes(path).unwrap_or_default(),
        }
    }

    fn files(&self) -> &dyn DatasetFiles {
        match self {
            FilesOfDataset::Folder(folder) => folder,
            FilesOfDataset::Recording(dataset) => dataset,
        }
    }
}

impl DatasetFiles for FilesOfDataset {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        self.files().read(path)
    }

    fn read_run(&self, path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        let FilesOfDataset::Folder(folder) = self else {
            return self.files().read_run(path, manifest);
        };
        let Some(read) = formats::run_reader(path) else {
            return folder.read_run(path, manifest);
        };
        let file = folder.path_of(path);
        require_regular(&file)?;
        read(RunFile::OnDisk(&file), &manifest.columns, &manifest.train_rows)
            .map(RunContent::Columns)
    }

    fn label(&self, path: &str) -> String {
        self.files().label(path)
    }
}

/// Reads the declarations of a dataset, but no run.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn open<'p>(
    source: impl Into<DatasetSource<'p>>,
) -> Result<(FilesOfDataset, DatasetHead), LoadError> {
    let source = source.into();
    if !is_recording(source.path) {
        let (folder, head) = dynocar::dataset::open(source)?;
        return Ok((FilesOfDataset::Folder(folder), head));
    }
    let files = FilesOfDataset::at(source)?;
    let head = DatasetHead::open(&files)?;
    Ok((files, head))
}

/// Reads a dataset with all its runs.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn load<'p>(source: impl Into<DatasetSource<'p>>) -> Result<Dataset, LoadError> {
    let (files, head) = open(source)?;
    Ok(head.read(&files)?)
}

/// Returns the way from a folder, which need not be there yet, to a file.
pub fn from_folder(folder: &Path, file: &Path) -> PathBuf {
    relative(&real(file), &real(folder))
}

/// Returns a path without links, as far as it is there.
pub fn real(path: &Path) -> PathBuf {
    let full = std::path::absolute(path).unwrap_or_else(|_| path.into());
    for known in full.ancestors() {
        if let Ok(start) = known.canonicalize() {
            let rest = full.strip_prefix(known).unwrap_or(Path::new(""));
            return start.join(rest).components().collect();
        }
    }
    full
}

/// Returns the way from a folder to a file, both in full.
fn relative(file: &Path, folder: &Path) -> PathBuf {
    let (file, folder): (Vec<Component>, Vec<Component>) =
        (file.components().collect(), folder.components().collect());
    let shared = file.iter().zip(&folder).take_while(|(one, other)| one == other).count();
    let up = folder[shared..].iter().map(|_| Component::ParentDir);
    up.chain(file[shared..].iter().copied()).collect()
}

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
    #[error(
        "{place}: names {file:?}: expected a path below the dataset's folder, since a recording holds its files: copy \
         it there, and name the copy"
    )]
    Outside {
        /// Where the manifest names it.
        place: SourcePosition,
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
    let described = [&manifest.train_file].into_iter().chain(&manifest.track_file);
    let named: Vec<(&String, &SourcePosition)> = described
        .map(|it| (&it.path, &it.place))
        .chain(manifest.runs.iter().map(|it| (&it.file, &it.place)))
        .collect();
    let is_plain = |it: Component| matches!(it, Component::Normal(_));
    let is_outside = |name: &String| !Path::new(name).components().all(is_plain);
    if let Some((file, place)) = named.iter().find(|it| is_outside(it.0)) {
        let (file, place) = (file.to_string(), (*place).clone());
        return Err(FromDatasetError::Outside { place, file });
    }
    let mut names = vec![MANIFEST_FILE.to_owned()];
    names.extend(named.into_iter().map(|it| it.0.clone()));
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
