//! Memory of the learner from round to round. It saves work and repetition, and no result depends on it: a lost memory
//! starts anew, since candidates and events are in the store.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use dynocar_shared::TrainId;
use serde::{Deserialize, Serialize};
use tracing::warn;

use dynocar::models::{ModelHash, UtcSecond};
use dynocar::state::{StateError, StateProblem, file};

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
