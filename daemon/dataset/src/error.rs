//! Errors of the files that people write, and their places.

use std::fmt::Display;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourcePosition {
    /// The file, as the user would find it.
    pub file: String,
    /// Line in the file, from 1; `None` when the whole file is meant.
    pub line: Option<usize>,
}

impl SourcePosition {
    /// A line, from 1, of a file.
    pub fn line(file: &str, line: usize) -> Self {
        SourcePosition { file: file.into(), line: Some(line) }
    }

    /// A file as a whole.
    pub fn whole(file: &str) -> Self {
        SourcePosition { file: file.into(), line: None }
    }

    /// A problem at this place: what was expected, and what came.
    pub fn problem(self, words: impl Display) -> DatasetError {
        DatasetError { place: self, words: words.to_string() }
    }
}

impl Display for SourcePosition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.file),
            None => f.write_str(&self.file),
        }
    }
}

/// Why a file is refused, and where.
///
/// Keys are written with their table, as `train.mass_t`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {words}")]
pub struct DatasetError {
    /// File and line.
    pub place: SourcePosition,
    /// Expected and found values.
    pub words: String,
}

/// Error of an empty file.
pub(crate) const NO_HEADER: &str =
    "expected a header line with the columns' names, found an empty file";
/// Error of a file of names alone.
pub(crate) const NO_ROWS: &str = "expected rows of values below the header, found none";

/// Why a file's text cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FileProblem {
    /// There is no such file.
    #[error("no such file")]
    Missing,
    /// It is a folder.
    #[error("expected a file, found a folder")]
    IsFolder,
    /// It is neither a file nor a folder: reading it may never end.
    #[error("expected a file, found {0}")]
    NotRegular(&'static str),
    /// Its first bytes show another format.
    #[error("expected text, found {0}")]
    NotText(&'static str),
    /// More bytes than are read.
    #[error("expected at most {most} bytes, found {found}: split the recording into runs")]
    TooLarge {
        /// The bound.
        most: u64,
        /// The file's size.
        found: u64,
    },
    /// The bytes are not UTF-8.
    #[error("not UTF-8: save the file as UTF-8")]
    NotUtf8 {
        /// First line, from 1, with other bytes.
        line: usize,
    },
    /// The bytes of a run's file are not valid in the declared encoding.
    #[error(
        "not {expected}: save the file as UTF-8, or set its own encoding in [dataset], as encoding = \
         \"windows-1252\""
    )]
    OtherEncoding {
        /// First line, from 1, with other bytes.
        line: usize,
        /// The encoding that is declared, or was taken for granted.
        expected: &'static str,
    },
    /// The system refuses to read it.
    #[error("cannot be read: {0}")]
    Unreadable(std::io::ErrorKind),
    /// A file that is not text and cannot be read as a table of numbers; the words are those of its reader.
    #[error("{0}")]
    Table(String),
}

impl FileProblem {
    /// The error of a file that was named itself and cannot be read.
    pub fn of(self, label: &str) -> DatasetError {
        let line = match self {
            FileProblem::NotUtf8 { line } | FileProblem::OtherEncoding { line, .. } => Some(line),
            _ => None,
        };
        SourcePosition { file: label.into(), line }.problem(self)
    }
}
