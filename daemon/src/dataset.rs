//! Datasets on disk.

use std::path::{Path, PathBuf};

use dynocar_dataset::text_layout::decoded;
use dynocar_dataset::{
    Dataset, DatasetError, DatasetFiles, DatasetHead, FileProblem, MANIFEST_FILE, Manifest,
    RunContent, formats, parse_track, parse_train, top_keys,
};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::TrainId;

use crate::text_file::read_bytes;
pub use crate::text_file::read_text;

/// A path that leads to a dataset, and the selected train where a recording holds several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatasetSource<'p> {
    /// The dataset's folder, its `dataset.toml`, or a recording.
    pub path: &'p Path,
    /// The train of a recording; `None` for its only one.
    pub train: Option<TrainId>,
}

impl<'p, P: AsRef<Path> + ?Sized> From<&'p P> for DatasetSource<'p> {
    fn from(path: &'p P) -> Self {
        DatasetSource { path: path.as_ref(), train: None }
    }
}

/// The dataset of a command.
#[derive(Clone, Debug, clap::Args)]
pub struct SourceArguments {
    /// The dataset's folder, or a recording
    pub dataset: PathBuf,
    /// Only this train of a recording that holds several
    #[arg(long, value_name = "ID")]
    pub train: Option<u64>,
}

impl SourceArguments {
    /// Returns the path with the train.
    pub fn source(&self) -> DatasetSource<'_> {
        DatasetSource { path: &self.dataset, train: self.train.map(TrainId) }
    }
}

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
    #[error("{}: not a dataset: the folder holds no {MANIFEST_FILE}{hint}", path.display())]
    NotADataset {
        /// The folder.
        path: PathBuf,
        /// Which file in it to give instead; empty without one.
        hint: String,
    },
    /// The file is no manifest.
    #[error("{}: {found}; expected a dataset's folder or its {MANIFEST_FILE}", path.display())]
    NoManifest {
        /// The file.
        path: PathBuf,
        /// Kind of file that was found.
        found: &'static str,
    },
    /// A train is chosen where there is one alone.
    #[error("{}: a dataset is of one train: --train chooses one of a recording", path.display())]
    NoRecording {
        /// The dataset.
        path: PathBuf,
    },
    /// A recording holds no dataset that can be read.
    #[error("{problem}")]
    Recording {
        /// The recording.
        path: PathBuf,
        /// Why not; it names the file.
        problem: String,
    },
    /// A file of the dataset is wrong.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// A dataset's folder; the manifest may have another name than [`MANIFEST_FILE`] when it is
/// given itself.
#[derive(Clone, Debug)]
pub struct DatasetFolder {
    folder: PathBuf,
    manifest: PathBuf,
}

impl DatasetFolder {
    /// Returns the dataset at a path: its folder, or its `dataset.toml`.
    ///
    /// # Errors
    ///
    /// When there is nothing, or a folder that is no dataset.
    pub fn at<'p>(source: impl Into<DatasetSource<'p>>) -> Result<Self, LoadError> {
        let DatasetSource { path, train } = source.into();
        if train.is_some() && path.exists() {
            return Err(LoadError::NoRecording { path: path.into() });
        }
        if path.is_dir() {
            let manifest = path.join(MANIFEST_FILE);
            if !manifest.exists() {
                return Err(LoadError::NotADataset { path: path.into(), hint: described(path) });
            }
            return Ok(DatasetFolder { folder: path.into(), manifest });
        }
        if !path.exists() {
            return Err(LoadError::NoSuchPath { path: path.into() });
        }
        if path.is_file() && path.extension().is_none_or(|extension| extension != "toml") {
            return Err(LoadError::NoManifest { path: path.into(), found: "not a TOML file" });
        }
        let folder = path.parent().unwrap_or(Path::new("")).into();
        Ok(DatasetFolder { folder, manifest: path.into() })
    }

    /// Returns where a file lies that the dataset names.
    pub fn path_of(&self, path: &str) -> PathBuf {
        if path == MANIFEST_FILE { self.manifest.clone() } else { self.folder.join(path) }
    }
}

impl DatasetFiles for DatasetFolder {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        read_text(&self.path_of(path))
    }

    fn read_run(&self, path: &str, manifest: &Manifest) -> Result<RunContent, FileProblem> {
        let (format, encoding) = (formats::of_run(path), manifest.layout.encoding);
        if format.needs_library() {
            return Err(format.is_not_text());
        }
        let text = decoded(read_bytes(&self.path_of(path), encoding)?, encoding)?;
        format.rows(text).map(RunContent::Text)
    }

    fn label(&self, path: &str) -> String {
        self.path_of(path).display().to_string()
    }
}

/// Returns which files of a folder describe a dataset under another name, in words; empty for none.
fn described(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|it| it == "toml"))
        .filter(|path| {
            let keys = read_text(path).map(|text| top_keys(&path.display().to_string(), &text));
            matches!(keys, Ok(Ok(keys)) if kind_of(&keys) == Some(FileKind::Dataset))
        })
        .map(|path| path.display().to_string())
        .collect();
    names.sort();
    if names.is_empty() { String::new() } else { format!("; give {} itself", names.join(" or ")) }
}

/// Reads the declarations of a dataset, but no run.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn open<'p>(
    source: impl Into<DatasetSource<'p>>,
) -> Result<(DatasetFolder, DatasetHead), LoadError> {
    let folder = DatasetFolder::at(source)?;
    let head = DatasetHead::open(&folder).map_err(|error| other_kind(&folder.manifest, error))?;
    Ok((folder, head))
}

/// Returns the error of a file that is a train, a line or a configuration where a dataset is expected;
/// else the one that there was.
fn other_kind(path: &Path, error: DatasetError) -> LoadError {
    let label = path.display().to_string();
    let keys = match read_text(path).map(|text| top_keys(&label, &text)) {
        Ok(Ok(keys)) => keys,
        _ => return error.into(),
    };
    let found = match kind_of(&keys) {
        Some(FileKind::Train) => "a train's file",
        Some(FileKind::Track) => "a line's file",
        Some(FileKind::Daemon) => "a daemon's configuration",
        Some(FileKind::Dataset) | None => return error.into(),
    };
    LoadError::NoManifest { path: path.into(), found }
}

/// Kind of a TOML file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FileKind {
    /// A `dataset.toml`.
    Dataset,
    /// A `train.toml`.
    Train,
    /// A `track.toml`.
    Track,
    /// A `daemon.toml`.
    Daemon,
}

/// Returns the kind of a TOML file by its tables. A dataset names its train and track in tables of the same names,
/// so that `[dataset]` decides first.
pub fn kind_of(keys: &[String]) -> Option<FileKind> {
    let has = |name: &str| keys.iter().any(|key| key == name);
    let kinds = [
        ("dataset", FileKind::Dataset),
        ("daemon", FileKind::Daemon),
        ("pipelines", FileKind::Daemon),
        ("train", FileKind::Train),
        ("track", FileKind::Track),
    ];
    kinds.into_iter().find(|(table, _)| has(table)).map(|(_, kind)| kind)
}

/// Reads a dataset with all its runs.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn load<'p>(source: impl Into<DatasetSource<'p>>) -> Result<Dataset, LoadError> {
    let (folder, head) = open(source)?;
    Ok(head.read(&folder)?)
}

/// Reads a train file.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn load_train(path: &Path) -> Result<TrainModel, LoadError> {
    let (label, text) = labelled_text(path)?;
    Ok(parse_train(&label, &text)?)
}

/// Reads a track file.
///
/// # Errors
///
/// The first mistake, with file, line and choices.
pub fn load_track(path: &Path) -> Result<Track, LoadError> {
    let (label, text) = labelled_text(path)?;
    Ok(parse_track(&label, &text)?)
}

/// Returns a file's name in messages and its text.
///
/// # Errors
///
/// When it cannot be read.
pub fn labelled_text(path: &Path) -> Result<(String, String), DatasetError> {
    let label = path.display().to_string();
    let text = read_text(path).map_err(|problem| problem.of(&label))?;
    Ok((label, text))
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
    fn paths_without_a_dataset_are_distinguished() {
        let folder =
            folder(&[("dataset.toml", MANIFEST.as_bytes()), ("latin.toml", b"# a\n# \xb0C\n")]);
        let path = folder.path();
        let shown = path.display();
        assert_eq!(refusal(&path.join("no")), format!("{shown}/no: no such file or folder"));
        assert_eq!(
            refusal(&path.join("runs")),
            format!("{shown}/runs: not a dataset: the folder holds no dataset.toml")
        );
        std::fs::create_dir(path.join("raw")).unwrap();
        std::fs::write(path.join("raw/day.toml"), MANIFEST).unwrap();
        assert_eq!(
            refusal(&path.join("raw")),
            format!(
                "{shown}/raw: not a dataset: the folder holds no dataset.toml; give \
                 {shown}/raw/day.toml itself"
            )
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
