//! Records of the store with numbers, `000001.toml` onwards, written once, read in order, never rewritten; decisions on
//! models among them, and the resulting model in force; errors of the store.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use dynocar_dataset::{DatasetError, FileProblem};
use dynocar_model::named;
use dynocar_shared::TrainId;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::text::ModelHash;
use crate::dataset::read_text;
use crate::stamp::UtcSecond;
use crate::storage::{Storage, StorageError, part_of, write_once};

/// Why the store of models does not give or take something.
#[derive(Debug, thiserror::Error)]
pub enum ModelsError {
    /// The system does not write.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A file or folder of the store cannot be read.
    #[error("{path}: {problem}")]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// Why not.
        problem: FileProblem,
    },
    /// A file of the store is not of the form that the store writes.
    #[error("{path}: no record of a store of models: {message}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Message of the reader.
        message: String,
    },
    /// The files of a model are no longer those that were put there.
    #[error(
        "{path}: changed after it was put into the store: its files have the hash {found}; it is \
         not used"
    )]
    Changed {
        /// The model's folder.
        path: PathBuf,
        /// The hash of the present contents.
        found: ModelHash,
    },
    /// There is no such model.
    #[error("the store holds no model {hash} of train {train}; `dynocar models list` names them")]
    NoModel {
        /// The model.
        hash: ModelHash,
        /// The train.
        train: TrainId,
    },
    /// The model is in force already.
    #[error("model {hash} is in force already")]
    InForce {
        /// The model.
        hash: ModelHash,
    },
    /// Nothing was adopted that could be taken back.
    #[error("train {train}: what the configuration declares is in force: nothing to roll back")]
    NothingAdopted {
        /// The train.
        train: TrainId,
    },
    /// A decision is somebody's.
    #[error("a decision needs the name of who decides, found none")]
    NoName,
    /// A model's file is wrong.
    #[error(transparent)]
    Model(#[from] DatasetError),
}

/// A record with its number.
pub type Numbered<T> = (u64, T);

/// Returns the names in a folder, sorted; an empty list where there is no such folder.
pub(super) fn names_in(folder: &Path) -> Result<Vec<String>, ModelsError> {
    let failed = |error: std::io::Error| ModelsError::Unreadable {
        path: folder.into(),
        problem: FileProblem::Unreadable(error.kind()),
    };
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(failed)?,
    };
    let mut names = Vec::new();
    for entry in entries {
        names.push(entry.map_err(failed)?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    Ok(names)
}

/// Returns the text of a file of the store.
pub(super) fn text_of(path: &Path) -> Result<String, ModelsError> {
    read_text(path).map_err(|problem| ModelsError::Unreadable { path: path.into(), problem })
}

/// Reads a file of the store.
pub(super) fn read_record<T: DeserializeOwned>(path: &Path) -> Result<T, ModelsError> {
    toml::from_str(&text_of(path)?).map_err(|error| ModelsError::Malformed {
        path: path.into(),
        message: error.to_string().trim_end().replace('\n', " "),
    })
}

/// Returns all records of a folder, by their numbers.
///
/// # Errors
///
/// When one cannot be read: the others alone would give another history.
pub fn read_all<T: DeserializeOwned>(folder: &Path) -> Result<Vec<Numbered<T>>, ModelsError> {
    let mut records = Vec::new();
    for name in names_in(folder)? {
        if let Some(number) = number_of(&name) {
            records.push((number, read_record(&folder.join(name))?));
        }
    }
    records.sort_by_key(|(number, _)| *number);
    Ok(records)
}

/// Writes the record of a number; false where another writer took it.
///
/// # Errors
///
/// The system's answer.
pub fn write<T: Serialize>(
    storage: &impl Storage,
    folder: &Path,
    number: u64,
    record: &T,
) -> Result<bool, ModelsError> {
    let path = path_of(folder, number);
    let text = toml::to_string(record).map_err(|error| ModelsError::Malformed {
        path: path.clone(),
        message: error.to_string(),
    })?;
    match write_once(storage, &path, &part_of(&path), text.as_bytes()) {
        Err(error) if error.source.kind() == ErrorKind::AlreadyExists => Ok(false),
        written => Ok(written.map(|()| true)?),
    }
}

/// Returns where the record of a number lies.
pub fn path_of(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("{number:06}.toml"))
}

fn number_of(name: &str) -> Option<u64> {
    let digits = name.strip_suffix(".toml")?;
    digits.bytes().all(|it| it.is_ascii_digit()).then(|| digits.parse().ok()).flatten()
}

named! {
    /// Decision on a model.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    Action ("as in the files") {
        /// The model is put in force.
        Adopted "adopted";
        /// The model in force is withdrawn; its predecessor is in force again.
        RolledBack "rolled_back";
        /// The model is not wanted: it is no candidate any more.
        Rejected "rejected";
    }
}

/// A decision that was taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    /// Decided action.
    pub action: Action,
    /// The model that was adopted or rejected, or that a rollback put in force again; absent for the declared model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelHash>,
    /// The model in force before; absent for the declared model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<ModelHash>,
    /// Who decided: a person's name, or `rule`.
    pub by: String,
    /// Why; may be empty.
    pub reason: String,
    /// When.
    pub at: UtcSecond,
}

/// A decision that is to be taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewDecision {
    /// Chosen decision.
    pub what: ModelChoice,
    /// Who decides: a person's name, or `rule`.
    pub by: String,
    /// Why; may be empty.
    pub reason: String,
    /// When.
    pub at: UtcSecond,
}

/// Choice between decisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    /// Put a model of the store in force.
    Adopt(ModelHash),
    /// Put the predecessor of the model in force in force again.
    RollBack,
    /// Strike a model of the store off the candidates.
    Reject(ModelHash),
}

/// Returns the models in force after some decisions, the present one last, each after its predecessor; empty while
/// nothing but the configuration's declaration is in force.
pub fn in_force_after<'d>(decisions: impl IntoIterator<Item = &'d Decision>) -> Vec<ModelHash> {
    let mut stack = Vec::new();
    for decision in decisions {
        match (decision.action, decision.model) {
            (Action::Adopted, Some(model)) => stack.push(model),
            (Action::RolledBack, model) => {
                stack.pop();
                // The model that a rollback names as in force is in force.
                match model {
                    None => stack.clear(),
                    Some(model) if stack.last() != Some(&model) => stack.push(model),
                    Some(_) => {}
                }
            }
            _ => {}
        }
    }
    stack
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rollback_goes_one_adoption_further_back() {
        let [a, b] = [1, 2].map(|hash| Some(ModelHash(hash)));
        let decision = |action, model| Decision {
            action,
            model,
            from: None,
            by: "rule".into(),
            reason: String::new(),
            at: UtcSecond { unix_s: 0 },
        };
        let (adopt, back) = (Action::Adopted, Action::RolledBack);
        let steps = [
            (adopt, a, vec![1]),
            (adopt, b, vec![1, 2]),
            (Action::Rejected, Some(ModelHash(3)), vec![1, 2]),
            (back, a, vec![1]),
            (back, None, vec![]),
            (adopt, b, vec![2]),
            (adopt, a, vec![2, 1]),
            (back, None, vec![]),
        ];
        let mut decisions = Vec::new();
        for (action, model, expected) in steps {
            decisions.push(decision(action, model));
            let expected: Vec<ModelHash> = expected.into_iter().map(ModelHash).collect();
            assert_eq!(in_force_after(&decisions), expected, "{decisions:?}");
        }
    }
}
