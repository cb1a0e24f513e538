//! The files of a recording that rotates: their names, and which of them go.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use dynocar::storage::Storage;

/// When a file is full, and how much of them is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rotation {
    /// Bytes after which a new file is begun.
    pub bytes: Option<u64>,
    /// Time after which a new file is begun.
    pub age: Option<Duration>,
    /// The most bytes that all files of the recording take; the oldest are removed.
    pub keep_bytes: Option<u64>,
    /// The age after which a file is removed.
    pub keep_age: Option<Duration>,
}

impl Rotation {
    /// True when new files are begun at all.
    pub fn is_on(self) -> bool {
        self.bytes.is_some() || self.age.is_some()
    }
}

/// The files of a rotating recording with their numbers, the oldest first.
pub fn numbered(output: &Path) -> Vec<(u64, PathBuf)> {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned() + "-";
    let number_of = |path: &Path| {
        let name = path.file_name()?.to_str()?.strip_prefix(&stem)?.strip_suffix(".mcap")?;
        (name.len() == DIGITS).then(|| name.parse().ok())?
    };
    let folder = dynocar::storage::folder_of(output);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(u64, PathBuf)> =
        entries.filter_map(|it| Some((number_of(&it.path())?, it.path()))).collect();
    files.sort();
    files
}

/// Digits of a file's number.
const DIGITS: usize = 6;

/// The name of the next file: `run-000007.mcap` for `run.mcap`.
pub fn next(output: &Path) -> PathBuf {
    let number = numbered(output).last().map_or(1, |newest| newest.0 + 1);
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    output.with_file_name(format!("{stem}-{number:0DIGITS$}.mcap"))
}

/// Removes the files that are too old, and the oldest until the rest takes no more than it may; never the
/// one that is written.
pub fn remove_oldest(storage: &dyn Storage, output: &Path, written: &Path, rotation: Rotation) {
    let most = rotation.keep_bytes.unwrap_or(u64::MAX);
    let oldest = rotation.keep_age.and_then(|age| SystemTime::now().checked_sub(age));
    let found = |(_, path): (u64, PathBuf)| {
        let known = std::fs::metadata(&path).ok()?;
        Some((known.modified().ok()?, known.len(), path))
    };
    let files: Vec<_> = numbered(output).into_iter().filter_map(found).collect();
    let mut total: u64 = files.iter().map(|it| it.1).sum();
    for (modified, length, path) in files.iter().filter(|it| it.2 != written) {
        let is_too_old = oldest.is_some_and(|oldest| *modified < oldest);
        if total > most || is_too_old {
            total -= length;
            // One that cannot be removed is reported when the disk is full.
            let _ = storage.remove(path);
        }
    }
}
