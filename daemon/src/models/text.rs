//! A model's files as text, and the hash by which a model is known.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use dynocar_dataset::{DatasetError, parse_track, parse_train};
use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::dataset::labelled_text;

/// The file of the train in a model's folder.
pub const TRAIN_FILE: &str = "train.toml";
/// The file of the line in a model's folder.
pub const TRACK_FILE: &str = "track.toml";

/// Identity of a model: the first 8 bytes, the highest first, of the SHA-256 of its train file, one zero byte, and
/// its track file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ModelHash(pub u64);

/// A text that is no hash of a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?}: expected the hash of a model, 16 hexadecimal digits")]
pub struct NoHash(String);

impl fmt::Display for ModelHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl FromStr for ModelHash {
    type Err = NoHash;

    fn from_str(text: &str) -> Result<Self, NoHash> {
        let is_plain = text.len() == 16 && text.bytes().all(|it| b"0123456789abcdef".contains(&it));
        let number = u64::from_str_radix(text, 16).ok().filter(|_| is_plain);
        number.map(ModelHash).ok_or_else(|| NoHash(text.into()))
    }
}

impl TryFrom<String> for ModelHash {
    type Error = NoHash;

    fn try_from(text: String) -> Result<Self, NoHash> {
        text.parse()
    }
}

impl From<ModelHash> for String {
    fn from(hash: ModelHash) -> String {
        hash.to_string()
    }
}

/// A model as its files spell it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelText {
    /// `train.toml`.
    pub train: String,
    /// `track.toml`, where the line is known.
    pub track: Option<String>,
}

impl ModelText {
    /// Reads the files of a model, wherever they lie.
    ///
    /// # Errors
    ///
    /// When one cannot be read.
    pub fn read(train: &Path, track: Option<&Path>) -> Result<Self, DatasetError> {
        let text = |path: &Path| labelled_text(path).map(|(_, text)| text);
        Ok(ModelText { train: text(train)?, track: track.map(text).transpose()? })
    }

    /// Returns the hash of the model.
    pub fn hash(&self) -> ModelHash {
        let track = self.track.as_deref().unwrap_or_default();
        let digest = Sha256::new()
            .chain_update(&self.train)
            .chain_update([0])
            .chain_update(track)
            .finalize();
        ModelHash(digest.iter().take(8).fold(0, |hash, &byte| hash << 8 | u64::from(byte)))
    }

    /// Returns the model, as every reader of such files understands it; the paths name them in messages.
    ///
    /// # Errors
    ///
    /// Message of the reader, with file and line.
    pub fn parse(
        &self,
        train: &Path,
        track: &Path,
    ) -> Result<(TrainModel, Option<Track>), DatasetError> {
        let read_track = |text: &str| parse_track(&track.display().to_string(), text);
        let train = parse_train(&train.display().to_string(), &self.train)?;
        Ok((train, self.track.as_deref().map(read_track).transpose()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hash_is_the_beginning_of_the_digest_of_both_files() {
        let text = |train: &str, track: Option<&str>| ModelText {
            train: train.into(),
            track: track.map(str::to_owned),
        };
        // printf 'a\0b' | sha256sum
        assert_eq!(text("a", Some("b")).hash().to_string(), "59b271ae1bbcb1d3");
        assert_eq!(text("a", None).hash(), text("a", Some("")).hash());
        assert_ne!(text("ab", None).hash(), text("a", Some("b")).hash());
    }

    #[test]
    fn a_hash_reads_back_as_it_is_shown_and_nothing_else_does() {
        let hash = ModelHash(0x00ab_cdef_0123_4567);
        assert_eq!(hash.to_string().parse(), Ok(hash));
        for wrong in ["", "abc", "00ABCDEF01234567", "+0abcdef01234567", "decisions"] {
            assert!(wrong.parse::<ModelHash>().is_err(), "{wrong}");
        }
    }
}
