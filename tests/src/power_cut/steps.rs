//! Requests to a disk, step by step, and the remains after a power cut.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use dynocar::storage::folder_of;

/// Contents of the disk after a cut, by name.
pub type Left = BTreeMap<PathBuf, Vec<u8>>;

/// Number of the newest changes of names that are tried in any combination; older ones count as done.
const NAMES_MAX: usize = 8;

/// One request to the disk.
#[derive(Clone, Debug)]
pub enum CutStep {
    /// Creates a file.
    Make { path: PathBuf, file: usize },
    /// Writes at the end of a file.
    Write { file: usize, bytes: Vec<u8> },
    /// Makes the written bytes of a file durable.
    SyncBytes { file: usize },
    /// Gives a file a second name.
    Link { to: PathBuf, file: usize },
    /// Renames a file.
    Rename { from: PathBuf, to: PathBuf, file: usize },
    /// Renames a folder, with all its files at once.
    RenameFolder { from: PathBuf, to: PathBuf },
    /// Removes a name.
    Remove { path: PathBuf },
    /// The names in a folder are there for good.
    SyncNames { folder: PathBuf },
}

impl CutStep {
    /// Returns the folder in which a step changes names.
    fn folder(&self) -> Option<&Path> {
        match self {
            CutStep::Make { path, .. } | CutStep::Remove { path } => Some(folder_of(path)),
            CutStep::Link { to, .. }
            | CutStep::Rename { to, .. }
            | CutStep::RenameFolder { to, .. } => Some(folder_of(to)),
            CutStep::Write { .. } | CutStep::SyncBytes { .. } | CutStep::SyncNames { .. } => None,
        }
    }
}

/// Bytes of a file: all, and how many of them are there for good.
#[derive(Clone, Debug, Default)]
struct Bytes {
    written: Vec<u8>,
    lasting: usize,
}

/// The disk after some steps.
#[derive(Debug, Default)]
pub struct AfterSteps {
    lasting_names: BTreeMap<PathBuf, usize>,
    changes: Vec<CutStep>,
    files: BTreeMap<usize, Bytes>,
}

impl AfterSteps {
    /// One step more.
    pub fn take(&mut self, step: &CutStep) {
        match step {
            CutStep::Write { file, bytes } => {
                self.files.entry(*file).or_default().written.extend_from_slice(bytes);
            }
            CutStep::SyncBytes { file } => {
                let bytes = self.files.entry(*file).or_default();
                bytes.lasting = bytes.written.len();
            }
            CutStep::SyncNames { folder } => {
                let changes = std::mem::take(&mut self.changes);
                let (done, open): (Vec<CutStep>, Vec<CutStep>) =
                    changes.into_iter().partition(|it| it.folder() == Some(folder));
                done.iter().for_each(|change| apply(change, &mut self.lasting_names));
                self.changes = open;
            }
            CutStep::Make { .. }
            | CutStep::Link { .. }
            | CutStep::Rename { .. }
            | CutStep::RenameFolder { .. }
            | CutStep::Remove { .. } => {
                self.changes.push(step.clone());
            }
        }
    }

    /// Returns everything that a cut now may leave.
    pub fn left(&self) -> Vec<Left> {
        let done = self.changes.len().saturating_sub(NAMES_MAX);
        let (old, open) = self.changes.split_at(done);
        let mut all = Vec::new();
        for chosen in 0..1_u32 << open.len() {
            let mut names = self.lasting_names.clone();
            old.iter().for_each(|change| apply(change, &mut names));
            for (index, change) in open.iter().enumerate() {
                if chosen >> index & 1 == 1 {
                    apply(change, &mut names);
                }
            }
            all.extend(self.with_bytes(&names));
        }
        all
    }

    /// Returns every combination of the contents that the named files may have; two names of a file have the same.
    fn with_bytes(&self, names: &BTreeMap<PathBuf, usize>) -> Vec<Left> {
        let mut names_of: BTreeMap<usize, Vec<&PathBuf>> = BTreeMap::new();
        for (path, file) in names {
            names_of.entry(*file).or_default().push(path);
        }
        let mut all = vec![Left::new()];
        for (file, paths) in names_of {
            let contents = self.files.get(&file).map_or(vec![Vec::new()], Bytes::contents);
            all = all
                .iter()
                .flat_map(|left| {
                    contents.iter().map(|content| {
                        let mut left = left.clone();
                        left.extend(paths.iter().map(|&path| (path.clone(), content.clone())));
                        left
                    })
                })
                .collect();
        }
        all
    }
}

impl Bytes {
    fn contents(&self) -> Vec<Vec<u8>> {
        let (lasting, open) = self.written.split_at(self.lasting);
        if open.is_empty() {
            return vec![lasting.into()];
        }
        let half = &open[..open.len() / 2];
        let zeros = vec![0; open.len()];
        vec![
            lasting.into(),
            [lasting, half].concat(),
            [lasting, &zeros].concat(),
            self.written.clone(),
        ]
    }
}

/// A change of names takes place.
pub fn apply(change: &CutStep, names: &mut BTreeMap<PathBuf, usize>) {
    match change {
        CutStep::Make { path, file } => {
            names.insert(path.clone(), *file);
        }
        CutStep::Link { to, file } => {
            names.insert(to.clone(), *file);
        }
        CutStep::Rename { from, to, file } => {
            names.remove(from);
            names.insert(to.clone(), *file);
        }
        CutStep::RenameFolder { from, to } => {
            let inside = |name: &PathBuf| Some(to.join(name.strip_prefix(from).ok()?));
            *names = std::mem::take(names)
                .into_iter()
                .map(|(name, file)| (inside(&name).unwrap_or(name), file))
                .collect();
        }
        CutStep::Remove { path } => {
            names.remove(path);
        }
        CutStep::Write { .. } | CutStep::SyncBytes { .. } | CutStep::SyncNames { .. } => {}
    }
}
