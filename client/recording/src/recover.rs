//! A recording that broke off made whole, or the files of one that rotated made one: everything that can
//! be read, with an index and an end.

use std::path::{Path, PathBuf};

use dynocar::storage::{Disk, Storage};
use mcap::McapError;

use crate::copying::{CopyError, copy};
use crate::reading::{Ending, ReadError};

/// Why a file is not made whole.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// It cannot be read at all.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The whole file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What stopped it.
        source: McapError,
    },
}

/// What was brought over.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    /// Messages.
    pub messages: u64,
    /// Attached files.
    pub attachments: u64,
    /// How each file ended.
    pub endings: Vec<Ending>,
}

/// Copies what can be read of files, in their order, into a new one, ours or not, and brings it to the disk.
/// One of several of which a power cut left nothing takes nothing from the others.
///
/// # Errors
///
/// When it is no MCAP file, or the new one cannot be written; then there is none.
pub fn recover(from: &[PathBuf], to: &Path) -> Result<Recovered, RecoverError> {
    recover_on(&Disk, from, to)
}

/// The same on any storage.
///
/// # Errors
///
/// As [`recover`].
pub fn recover_on(
    storage: &dyn Storage,
    from: &[PathBuf],
    to: &Path,
) -> Result<Recovered, RecoverError> {
    let copied = copy(storage, from, to, &mut (), |_, ()| Ok(())).map_err(|error| match error {
        CopyError::Read(error) => RecoverError::Read(error),
        CopyError::Write(source) => RecoverError::Write { path: to.into(), source },
    })?;
    let (messages, attachments) = (copied.messages, copied.attachments);
    Ok(Recovered { messages, attachments, endings: copied.endings })
}
