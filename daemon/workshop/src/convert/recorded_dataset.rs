//! A recording as a dataset in memory: its files by their names, and runs that are samples.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use dynocar::text_file::{require_text, text_of};
use dynocar_analysis::dataset::text_layout::decoded;
use dynocar_analysis::dataset::{DatasetFiles, FileProblem, Manifest, RunContent, formats};
use dynocar_shared::TrainSample;

use super::rows::{columns_of_samples, to_rows};
use crate::formats::{RunFile, run_reader};

/// Contents of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum FileContent {
    /// Bytes of an attached file.
    Bytes(Vec<u8>),
    /// Samples of a recorded run.
    Samples(Vec<TrainSample>),
}

/// A recording as a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedDataset {
    recording: PathBuf,
    files: Vec<(String, FileContent)>,
}

impl RecordedDataset {
    /// One without files.
    pub fn new(recording: &Path) -> Self {
        RecordedDataset { recording: recording.into(), files: Vec::new() }
    }

    /// Adds a file, or replaces that of the same name.
    pub fn put(&mut self, name: &str, content: FileContent) {
        self.files.retain(|it| it.0 != name);
        self.files.push((name.into(), content));
    }

    /// Returns the names of its files.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|it| it.0.as_str())
    }

    /// Returns the bytes of a file as [`unpack`](super::unpack) writes it; `None` where there is none.
    pub fn bytes(&self, path: &str) -> Option<Cow<'_, [u8]>> {
        Some(match self.file(path)? {
            FileContent::Bytes(bytes) => bytes.into(),
            FileContent::Samples(samples) => to_rows(samples).into_bytes().into(),
        })
    }

    fn file(&self, path: &str) -> Option<&FileContent> {
        // One path may be written in several ways.
        let found = self.files.iter().find(|it| Path::new(&it.0) == Path::new(path));
        found.map(|it| &it.1)
    }
}

impl DatasetFiles for RecordedDataset {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        text_of(self.bytes(path).ok_or(FileProblem::Missing)?.into_owned())
    }

    fn read_run(&self, path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        match self.file(path).ok_or(FileProblem::Missing)? {
            FileContent::Samples(samples) => {
                Ok(RunContent::Columns(columns_of_samples(samples, &manifest.columns)))
            }
            FileContent::Bytes(bytes) => {
                if let Some(read) = run_reader(path) {
                    return read(RunFile::Attached(bytes), &manifest.columns, &manifest.train_rows)
                        .map(RunContent::Columns);
                }
                let encoding = manifest.layout.encoding;
                require_text(bytes, encoding)?;
                let text = decoded(bytes.clone(), encoding)?;
                formats::of_run(path).rows(text).map(RunContent::Text)
            }
        }
    }

    fn label(&self, path: &str) -> String {
        format!("{}/{path}", self.recording.display())
    }
}
