//! Recordings, each unpacked once into a folder of the learner, because the flight recorder's ring deletes the oldest
//! ones.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use dynocar_shared::TrainId;
use serde::{Deserialize, Serialize};
use tracing::info;

use super::LearnError;
use super::memory::LearnerMemory;
use crate::convert::{ModelFiles, ToDatasetError, to_dataset};
use dynocar::models::UtcSecond;
use dynocar::storage::{Disk, Storage, StorageError, part_of};

/// Last bytes of a finished recording.
const MCAP_END: &[u8] = b"\x89MCAP0\r\n";
/// File in an unpacked recording that names its source.
const SOURCE_FILE: &str = "recording.toml";
/// Greatest total size in bytes of the unpacked recordings of a train.
const BYTES_MAX: u64 = 4 << 30;

/// Source of an unpacked recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordingSource {
    /// The recording's name.
    pub name: String,
    /// When it was finished.
    pub recorded: UtcSecond,
}

/// Returns true for a recording that is no longer written.
pub fn is_finished(path: &Path) -> bool {
    let end = || -> io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::End(-(MCAP_END.len() as i64)))?;
        let mut end = Vec::new();
        file.read_to_end(&mut end)?;
        Ok(end)
    };
    end().is_ok_and(|end| end == MCAP_END)
}

/// Unpacks the runs of a train from a recording, unless that was done before; `sha256` is the hash of the recording's
/// content. A recording that cannot be used is reported once.
///
/// # Errors
///
/// When the unpacked files cannot be written.
pub fn take_up(
    (recording, sha256): (&Path, &str),
    train: TrainId,
    (folder, memory): (&Path, &mut LearnerMemory),
    recorded: UtcSecond,
) -> Result<(), LearnError> {
    let key = format!("{train}:{sha256}");
    let unpacked = folder.join(&sha256[..16]);
    if unpacked.exists() || memory.unusable.contains_key(&key) {
        return Ok(());
    }
    let failed = |action| {
        move |source| LearnError::Storage(StorageError { path: folder.into(), action, source })
    };
    Disk.make_folder(folder).map_err(failed("making the folder"))?;
    let part = part_of(&unpacked);
    let paths = [recording.to_path_buf()];
    if let Err(error) = to_dataset(&paths, &part, Some(train.0), &ModelFiles::default()) {
        let _ = std::fs::remove_dir_all(&part);
        if let ToDatasetError::Output(_) = error {
            return Err(error.into());
        }
        info!(train = train.0, "a recording is not used: {error}");
        memory.unusable.insert(key, error.to_string());
        return Ok(());
    }
    let name = recording.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let source = toml::to_string(&RecordingSource { name, recorded }).unwrap_or_default();
    std::fs::write(part.join(SOURCE_FILE), source)
        .and_then(|()| Disk.rename_new(&part, &unpacked))
        .map_err(failed("unpacking a recording into the folder"))
}

/// Returns the folders of the unpacked recordings in one, the oldest first; the oldest go until the rest takes no more
/// than it may.
pub fn unpacked_in(folder: &Path) -> Vec<(PathBuf, RecordingSource)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<(PathBuf, RecordingSource)> = Vec::new();
    for folder in entries.map(|entry| entry.path()) {
        let source = std::fs::read_to_string(folder.join(SOURCE_FILE)).ok();
        match source.and_then(|text| toml::from_str(&text).ok()) {
            Some(source) => found.push((folder, source)),
            // Left by a learner that died; nobody else works here.
            None => remove(&folder),
        }
    }
    found.sort_by_key(|(folder, source)| (source.recorded, folder.clone()));
    let (mut kept, mut bytes) = (Vec::new(), 0);
    for (folder, source) in found.into_iter().rev() {
        bytes += bytes_in(&folder);
        if bytes > BYTES_MAX {
            remove(&folder);
        } else {
            kept.push((folder, source));
        }
    }
    kept.reverse();
    kept
}

fn remove(folder: &Path) {
    // Folders that cannot be removed are looked at again in the next round.
    let _ = std::fs::remove_dir_all(folder);
}

fn bytes_in(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let bytes = entries.map(|entry| match entry.metadata() {
        Ok(known) if known.is_dir() => bytes_in(&entry.path()),
        Ok(known) => known.len(),
        Err(_) => 0,
    });
    bytes.sum()
}
