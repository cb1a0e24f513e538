//! A dataset that is not written yet, read as it would be.

use std::path::Path;

use dynocar_analysis::dataset::{DatasetFiles, DatasetHead, FileProblem, Run};

use dynocar::cli::Failure;

/// A file of the dataset.
pub struct DraftFile<'t> {
    /// Path as the dataset names it.
    pub path: &'t str,
    /// Name in messages, where it is not the path from the dataset's folder.
    pub label: Option<&'t str>,
    /// What it will hold, or holds.
    pub text: &'t str,
}

/// The dataset's files.
pub struct Draft<'t> {
    /// Where they will be.
    pub folder: &'t Path,
    /// The files.
    pub files: Vec<DraftFile<'t>>,
}

impl DatasetFiles for Draft<'_> {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        self.file(path).map(|file| file.text.into()).ok_or(FileProblem::Missing)
    }

    fn label(&self, path: &str) -> String {
        let label = self.file(path).and_then(|file| file.label);
        label.map_or_else(|| self.folder.join(path).display().to_string(), Into::into)
    }
}

impl Draft<'_> {
    fn file(&self, path: &str) -> Option<&DraftFile<'_>> {
        self.files.iter().find(|file| file.path == path)
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
