//! The learner's memory from round to round, and its recordings, each unpacked once into a folder of the
//! learner, because the flight recorder's ring deletes the oldest ones.
//!
//! The memory saves work and repetition, and no result depends on it: a lost memory starts anew, since candidates and
//! events are in the store.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use dynocar::models::{ModelHash, UtcSecond};
use dynocar::state::{StateError, StateProblem, file};
use dynocar::storage::{Disk, Storage, StorageError, part_of};
use dynocar_shared::TrainId;
use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use super::LearnError;
use crate::convert::{ModelFiles, ToDatasetError, to_dataset};

/// The file of the memory.
const FILE: &str = "learn.state";
/// Greatest number of remembered files; further files are hashed anew in each round.
const FILES_MAX: usize = 2000;
/// Greatest number of remembered problems and questions; further ones are reported again.
const REPORTED_MAX: usize = 400;

/// A file whose content is known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KnownFile {
    /// Its size.
    pub bytes: u64,
    /// When it was changed, in ns since 1970.
    pub modified_ns: u64,
    /// SHA-256 of its content.
    pub sha256: String,
}

/// Question that recorded runs do not settle, with the experiment that would.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenQuestion {
    /// The train.
    pub train: u64,
    /// When it was asked.
    pub at: UtcSecond,
    /// The model in force.
    pub model: ModelHash,
    /// The verdict.
    pub verdict: String,
    /// Kinds of effects that it is about.
    pub kinds: Vec<String>,
    /// The verdict in a sentence.
    pub statement: String,
    /// Experiment that would settle it.
    pub experiment: Option<String>,
}

impl OpenQuestion {
    /// Returns true for the same question, asked at another time.
    pub fn is_same_as(&self, other: &OpenQuestion) -> bool {
        (self.train, self.model, &self.verdict, &self.kinds)
            == (other.train, other.model, &other.verdict, &other.kinds)
    }
}

/// The memory.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LearnerMemory {
    /// Known files by path.
    #[serde(default)]
    pub files: BTreeMap<PathBuf, KnownFile>,
    /// Why something cannot be used, by the hash of its content.
    #[serde(default)]
    pub unusable: BTreeMap<String, String>,
    /// Digest of the inputs of the last explanation, by train.
    #[serde(default)]
    pub explained: BTreeMap<String, String>,
    /// Reported open questions.
    #[serde(default)]
    pub open: Vec<OpenQuestion>,
}

impl LearnerMemory {
    /// Returns the memory in a folder. One that is damaged is reported and begun anew.
    pub fn load(folder: &Path) -> Self {
        let path = folder.join(FILE);
        let read = |text: String| {
            let malformed = |error: toml::de::Error| error.message().to_owned();
            toml::from_str(&text).map_err(malformed)
        };
        let loaded = match file::read(&path) {
            Ok(None) => return LearnerMemory::default(),
            Ok(Some(text)) => read(text),
            Err(error) => Err(error.to_string()),
        };
        loaded.unwrap_or_else(|problem| {
            warn!("what was learned from is forgotten, every run is looked at anew: {problem}");
            LearnerMemory::default()
        })
    }

    /// Writes the memory into a folder.
    ///
    /// # Errors
    ///
    /// When it cannot be written; the one there stays as it is.
    pub fn save(&mut self, folder: &Path) -> Result<(), StateError> {
        self.files.retain(|path, _| path.exists());
        while self.files.len() > FILES_MAX {
            self.files.pop_first();
        }
        while self.unusable.len() > REPORTED_MAX {
            self.unusable.pop_first();
        }
        let surplus = self.open.len().saturating_sub(REPORTED_MAX);
        self.open.drain(..surplus);
        let path = folder.join(FILE);
        let text = toml::to_string(self)
            .map_err(|error| StateProblem::Malformed(error.to_string()).at(&path))?;
        file::replace(&path, &text)
    }

    /// Writes a question down; false for one that was asked before.
    pub fn ask(&mut self, question: &OpenQuestion) -> bool {
        let is_new = !self.open.iter().any(|it| it.is_same_as(question));
        if is_new {
            self.open.push(question.clone());
        }
        is_new
    }

    /// Returns the questions of a train.
    pub fn open_of(&self, train: TrainId) -> impl Iterator<Item = &OpenQuestion> {
        self.open.iter().filter(move |it| it.train == train.0)
    }
}

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
