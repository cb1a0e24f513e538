//! Records with numbers, `000001.toml` onwards: written once, read in order, never rewritten.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use dynocar_dataset::FileProblem;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::ModelsError;
use crate::dataset::read_text;
use crate::storage::{Storage, part_of, write_once};

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
