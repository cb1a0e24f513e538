//! A dataset that is not written yet, read as it would be.

use std::path::Path;

use dynocar_analysis::dataset::guess::Recording;
use dynocar_analysis::dataset::{DatasetFiles, DatasetHead, FileProblem, MANIFEST_FILE, Run};

use crate::cli::train_text::TRAIN_FILE;
use crate::track_text::TRACK_FILE;
use dynocar::cli::Failure;

/// The texts of a dataset's files.
pub struct Draft<'t> {
    /// Where it will be.
    pub folder: &'t Path,
    /// `dataset.toml`.
    pub dataset: &'t str,
    /// `train.toml`.
    pub train: &'t str,
    /// `track.toml`, where there is one.
    pub track: Option<&'t str>,
    /// The runs: path as the dataset names it, and the file as it was given.
    pub csv: Vec<(&'t str, Recording<'t>)>,
}

impl DatasetFiles for Draft<'_> {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        let text = match path {
            MANIFEST_FILE => Some(self.dataset),
            TRAIN_FILE => Some(self.train),
            TRACK_FILE => self.track,
            path => self.recording(path).map(|recording| recording.text),
        };
        text.map(Into::into).ok_or(FileProblem::Missing)
    }

    fn label(&self, path: &str) -> String {
        match self.recording(path) {
            Some(recording) => recording.label.into(),
            None => self.folder.join(path).display().to_string(),
        }
    }
}

impl<'t> Draft<'t> {
    fn recording(&self, path: &str) -> Option<Recording<'t>> {
        self.csv.iter().find(|(name, _)| *name == path).map(|(_, recording)| *recording)
    }

    /// Reads the dataset with all its runs.
    ///
    /// # Errors
    ///
    /// The first mistake, with file and line.
    pub fn read(&self) -> Result<(DatasetHead, Vec<Run>), Failure> {
        let head = DatasetHead::open(self)?;
        let runs = (0..head.manifest.runs.len()).map(|index| head.read_run(self, index));
        let runs = runs.collect::<Result<_, _>>()?;
        Ok((head, runs))
    }
}
