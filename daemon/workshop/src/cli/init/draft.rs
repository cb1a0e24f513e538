//! A dataset that is not written yet, read as it would be.

use std::path::Path;

use dynocar_analysis::dataset::{DatasetFiles, DatasetHead, FileProblem, Run};

use dynocar::cli::Failure;

/// The dataset's files.
pub struct Draft<'t> {
    /// Where they will be.
    pub folder: &'t Path,
    /// Path of each as the dataset names it, its name in messages where that is not the path from the folder, and
    /// what it will hold, or holds.
    pub files: Vec<(&'t str, Option<&'t str>, &'t str)>,
}

impl DatasetFiles for Draft<'_> {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        self.file(path).map(|(_, text)| text.into()).ok_or(FileProblem::Missing)
    }

    fn label(&self, path: &str) -> String {
        let label = self.file(path).and_then(|(label, _)| label);
        label.map_or_else(|| self.folder.join(path).display().to_string(), Into::into)
    }
}

impl Draft<'_> {
    fn file(&self, path: &str) -> Option<(Option<&str>, &str)> {
        self.files.iter().find(|file| file.0 == path).map(|&(_, label, text)| (label, text))
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
