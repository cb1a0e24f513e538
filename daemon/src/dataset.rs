//! Datasets on disk.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use dynocar_core::dataset::{
    Dataset, DatasetError, DatasetFiles, DatasetHead, FileProblem, MANIFEST_FILE,
};

/// Why a path leads to no dataset.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// There is nothing at the path.
    #[error("{}: no such file or folder", path.display())]
    NoSuchPath {
        /// The path.
        path: PathBuf,
    },
    /// The folder holds no `dataset.toml`.
    #[error("{}: not a dataset: the folder holds no {MANIFEST_FILE}", path.display())]
    NotADataset {
        /// The folder.
        path: PathBuf,
    },
    /// A file of the dataset is wrong.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// A dataset's folder; the manifest may have another name than [`MANIFEST_FILE`] when it is
/// given itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DatasetFolder {
    folder: PathBuf,
    manifest: PathBuf,
}

impl DatasetFolder {
    /// The dataset at a path: its folder, or its `dataset.toml`.
    ///
    /// # Errors
    ///
    /// When there is nothing, or a folder that is no dataset.
    pub fn at(path: &Path) -> Result<Self, LoadError> {
        if path.is_dir() {
            let manifest = path.join(MANIFEST_FILE);
            if !manifest.exists() {
                return Err(LoadError::NotADataset { path: path.into() });
            }
            return Ok(DatasetFolder { folder: path.into(), manifest });
        }
        if !path.exists() {
            return Err(LoadError::NoSuchPath { path: path.into() });
        }
        let folder = path.parent().unwrap_or(Path::new("")).into();
        Ok(DatasetFolder { folder, manifest: path.into() })
    }

    fn path_of(&self, path: &str) -> PathBuf {
        if path == MANIFEST_FILE { self.manifest.clone() } else { self.folder.join(path) }
    }
}

impl DatasetFiles for DatasetFolder {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        read_text(&self.path_of(path))
    }

    fn label(&self, path: &str) -> String {
        self.path_of(path).display().to_string()
    }
}

/// Reads what a dataset declares, but no run.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn open(path: &Path) -> Result<(DatasetFolder, DatasetHead), LoadError> {
    let folder = DatasetFolder::at(path)?;
    let head = DatasetHead::open(&folder)?;
    Ok((folder, head))
}

/// Reads a dataset with all its runs.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn load(path: &Path) -> Result<Dataset, LoadError> {
    Ok(Dataset::load(&DatasetFolder::at(path)?)?)
}

/// Reads a text file.
///
/// # Errors
///
/// When there is none, it is a folder, not UTF-8 or not readable.
pub fn read_text(path: &Path) -> Result<String, FileProblem> {
    let bytes = std::fs::read(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => FileProblem::Missing,
        ErrorKind::IsADirectory => FileProblem::IsFolder,
        kind => FileProblem::Unreadable(kind),
    })?;
    String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        FileProblem::NotUtf8 { line: 1 + good.iter().filter(|&&byte| byte == b'\n').count() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANIFEST: &str = "[dataset]\nname='x'\n[train]\nfile='train.toml'\n[columns]\n\
        time={column='t',unit='s'}\nspeed={column='v',unit='m/s'}\n[[runs]]\nfile='runs/1.csv'\n";
    const TRAIN: &str = "[train]\nmass_t=100\nlength_m=80\nrotating_mass_factor=0.05\n\
        [resistance]\na=1\nb=0\nc=0\n";

    fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("runs")).unwrap();
        for (name, bytes) in files {
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        folder
    }

    fn refusal(path: &Path) -> String {
        load(path).unwrap_err().to_string()
    }

    #[test]
    fn a_folder_or_its_manifest_leads_to_the_dataset() {
        let files = [
            ("dataset.toml", MANIFEST.as_bytes()),
            ("train.toml", TRAIN.as_bytes()),
            ("runs/1.csv", b"t,v\n0,1\n1,2\n"),
        ];
        let folder = folder(&files);
        let dataset = load(folder.path()).unwrap();
        assert_eq!(dataset.runs[0].samples.len(), 2);
        assert_eq!(load(&folder.path().join("dataset.toml")).unwrap(), dataset);
        std::fs::rename(folder.path().join("dataset.toml"), folder.path().join("other.toml"))
            .unwrap();
        assert_eq!(load(&folder.path().join("other.toml")).unwrap(), dataset);
    }

    #[test]
    fn paths_without_a_dataset_are_told_apart() {
        let folder =
            folder(&[("dataset.toml", MANIFEST.as_bytes()), ("latin.toml", b"# a\n# \xb0C\n")]);
        let path = folder.path();
        let shown = path.display();
        assert_eq!(refusal(&path.join("no")), format!("{shown}/no: no such file or folder"));
        assert_eq!(
            refusal(&path.join("runs")),
            format!("{shown}/runs: not a dataset: the folder holds no dataset.toml")
        );
        assert_eq!(
            refusal(path),
            format!("{shown}/dataset.toml:4: {shown}/train.toml: no such file")
        );
        assert_eq!(
            refusal(&path.join("latin.toml")),
            format!("{shown}/latin.toml:2: not UTF-8: save the file as UTF-8")
        );
    }

    #[test]
    fn a_run_that_is_a_folder_is_named_where_it_is_listed() {
        let manifest = MANIFEST.replace("runs/1.csv", "runs");
        let folder =
            folder(&[("dataset.toml", manifest.as_bytes()), ("train.toml", TRAIN.as_bytes())]);
        let shown = folder.path().display();
        let message =
            format!("{shown}/dataset.toml:8: {shown}/runs: expected a file, found a folder");
        assert_eq!(refusal(folder.path()), message);
    }
}
