//! A dataset as it is under the model in force: its runs, with that model's train and line.

use std::path::Path;

use dynocar_analysis::dataset::{DatasetFiles, FileProblem, MANIFEST_FILE, Manifest, RunContent};
use toml::Table;

use crate::updated::name_model;
use dynocar::dataset::{DatasetFolder, LoadError};
use dynocar::models::ModelText;
use dynocar::models::text::{TRACK_FILE, TRAIN_FILE};

/// The files of a dataset, but for those of train and line.
#[derive(Debug)]
pub struct Overlay<'a> {
    dataset: DatasetFolder,
    model: &'a ModelText,
}

impl<'a> Overlay<'a> {
    /// The dataset in a folder with a model.
    ///
    /// # Errors
    ///
    /// When there is no dataset.
    pub fn at(folder: &Path, model: &'a ModelText) -> Result<Self, LoadError> {
        Ok(Overlay { dataset: DatasetFolder::at(folder)?, model })
    }

    /// The description, which names the files of the model.
    fn described(&self, text: String) -> String {
        let Ok(mut table) = text.parse::<Table>() else { return text };
        name_model(&mut table, self.model.track.is_some());
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
