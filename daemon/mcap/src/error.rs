//! Errors of files, with their paths.

use std::error::Error;
use std::fmt::{Debug, Display, Formatter};
use std::path::{Path, PathBuf};

use dynocar::cli::Failure;

use crate::schema::SAMPLE;
use crate::topic::CodecError;

/// An error of a file or a folder, with its path.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct AtPath<P> {
    /// The file or folder.
    pub path: PathBuf,
    /// Its error.
    pub problem: P,
}

impl<P> AtPath<P> {
    /// Returns a function that turns an error of a file into one with its path.
    pub fn of<T: Into<P>>(path: &Path) -> impl Fn(T) -> Self {
        move |problem| AtPath { path: path.into(), problem: problem.into() }
    }
}

/// Errors of a file that is to be a recording.
#[derive(Debug, thiserror::Error)]
pub enum ReadProblem {
    /// The system does not give it.
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    /// It is of another format.
    #[error("not an MCAP file: expected one that begins with the bytes of MCAP, version 0")]
    NotMcap,
    /// Its messages are of another release.
    #[error(
        "{topic}: recorded with another schema: expected {expected}, found {found}; read it with the release \
         of dynocar that recorded it"
    )]
    OtherSchema {
        /// The channel.
        topic: String,
        /// This release's layout.
        expected: &'static str,
        /// The file's.
        found: String,
    },
    /// Another tool has written it anew and left out which release recorded it.
    #[error(
        "{topic}: the channel does not say which layout its messages have, and their description is another than \
         this release's: another tool wrote the file anew; keep the channels' metadata there"
    )]
    NoLayout {
        /// The channel.
        topic: String,
    },
    /// A message does not match its channel's description.
    #[error("{topic}, message {number}: {source}")]
    Malformed {
        /// The channel.
        topic: String,
        /// The message's place in the file, counted from 1.
        number: u64,
        /// Error of the message.
        source: CodecError,
    },
    /// Several files are not given in the order in which they were recorded.
    #[error(
        "begins before {}: expected a recording's files in the order in which they were recorded",
        before.display()
    )]
    OutOfOrder {
        /// The one given before it.
        before: PathBuf,
    },
    /// Several files are not of one recording.
    #[error("{name} is another than in {}: expected files of one recording", before.display())]
    OtherRecording {
        /// One given before it.
        before: PathBuf,
        /// The attached file.
        name: String,
    },
    /// One file holds several recordings.
    #[error(
        "{name} is attached to it several times, each another: another tool has merged recordings of several \
         daemons; convert each of them by itself"
    )]
    Merged {
        /// The attached file.
        name: String,
    },
    /// There is no sample.
    #[error("no samples: expected a channel of {SAMPLE} messages, found {found}")]
    NoSamples {
        /// The channels that there are, in words.
        found: String,
    },
}

/// Why a file is no recording that can be read.
pub type ReadError = AtPath<ReadProblem>;
/// Why a file or a folder cannot be written.
pub type WriteError = AtPath<Unwritten>;

/// An error that stopped the writing: it wraps any error and is therefore not itself `Error`.
#[derive(Debug)]
pub struct Unwritten(Box<dyn Error + Send + Sync>);

impl Display for Unwritten {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "cannot be written: {}", self.0)
    }
}

impl<E: Error + Send + Sync + 'static> From<E> for Unwritten {
    fn from(error: E) -> Self {
        Unwritten(Box::new(error))
    }
}

/// Why a recording does not become another file.
#[derive(Debug, thiserror::Error)]
pub enum CopyError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The other file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// A file that is no recording is wrong input; one that cannot be written is not.
impl From<CopyError> for Failure {
    fn from(error: CopyError) -> Self {
        match error {
            CopyError::Read(error) => Failure::input(error),
            CopyError::Write(error) => Failure::work(error),
        }
    }
}
