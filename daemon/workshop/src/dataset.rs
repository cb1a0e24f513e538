//! The dataset at a path: a folder, or a recording, which becomes a dataset in memory.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use dynocar::dataset::{DatasetFolder, DatasetSource, LoadError};
use dynocar::output::report_line;
use dynocar::text_file::require_regular;
use dynocar_analysis::dataset::{
    Dataset, DatasetFiles, DatasetHead, FileProblem, Manifest, RunContent,
};
use dynocar_model::units::Unit;

use super::convert::{ModelFiles, RecordedDataset, dataset_of};
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
    load_with_speed_unit(source).map(|(dataset, _)| dataset)
}

/// Reads a dataset with all its runs, and the unit in which they hold the speed.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn load_with_speed_unit<'p>(
    source: impl Into<DatasetSource<'p>>,
) -> Result<(Dataset, Unit), LoadError> {
    let (files, head) = open(source)?;
    let unit = head.manifest.speed_unit();
    Ok((head.read(&files)?, unit))
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
