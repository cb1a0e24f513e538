//! What can be wrong with a dataset's files, and where.

use dynocar_model::track::TrackError;

use super::names::Choices;
use super::quantity::Quantity;

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

    /// A problem at this place.
    pub fn problem(self, problem: Problem) -> DatasetError {
        DatasetError { place: self, problem: Box::new(problem) }
    }
}

impl std::fmt::Display for SourcePosition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.file),
            None => f.write_str(&self.file),
        }
    }
}

/// Why a file of a dataset is refused, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct DatasetError {
    /// File and line.
    pub place: SourcePosition,
    /// What is wrong there.
    pub problem: Box<Problem>,
}

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
    /// The bytes of a run's file are none of the declared encoding's.
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
    /// What is no text does not become a table of numbers; the words are those of its reader.
    #[error("{0}")]
    Table(String),
}

/// What is wrong with a file of a dataset.
///
/// Keys are written with their table, as `train.mass_t`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The text of the file cannot be had.
    #[error("{0}")]
    File(FileProblem),
    /// The text of a file that the dataset lists cannot be had.
    #[error("{file}: {problem}")]
    ListedFile {
        /// The file, as the user would find it.
        file: String,
        /// Why not.
        problem: FileProblem,
    },
    /// The text does not follow the language.
    #[error("not valid {language}: {message}")]
    Syntax {
        /// `TOML`, `CSV`, `YAML` or `JSON`.
        language: &'static str,
        /// The parser's words.
        message: String,
    },
    /// A key, quantity, unit or other word that is not among the choices.
    #[error("unknown {what} '{name}'{context}{choices}")]
    UnknownName {
        /// What the word should have named.
        what: &'static str,
        /// The word.
        name: String,
        /// Where or for what it stands; empty or starting with a space.
        context: String,
        /// What it may be.
        choices: Choices,
    },
    /// A key that must be there is not.
    #[error("missing key {key}: expected {expected}")]
    MissingKey {
        /// The key.
        key: String,
        /// What it should hold.
        expected: String,
    },
    /// A value of the wrong type.
    #[error("{key}: expected {expected}, got {found}")]
    WrongType {
        /// The key.
        key: String,
        /// What it should hold.
        expected: String,
        /// What it holds.
        found: String,
    },
    /// A value outside its range.
    #[error("{key} = {value}: expected {allowed}")]
    OutOfRange {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// The allowed range, in words.
        allowed: String,
    },
    /// Two keys that exclude each other.
    #[error("{key} and {other} exclude each other: give one of them")]
    Exclusive {
        /// One key.
        key: String,
        /// The other key.
        other: String,
    },
    /// An entry of a list that does not follow the one before it.
    #[error(
        "{key} entry {index}: expected a speed above the one before ({before} m/s), got {found} m/s"
    )]
    EffortOrder {
        /// The list's key.
        key: String,
        /// Number of the entry, from 1.
        index: usize,
        /// The entry's speed in m/s.
        found: f64,
        /// Speed in m/s of the entry before.
        before: f64,
    },
    /// A list of track entries breaks a rule.
    #[error("{0}")]
    Track(TrackError),
    /// A run's file is listed twice.
    #[error("{key}: {file} is listed in line {first_line} already")]
    RepeatedRun {
        /// The key.
        key: String,
        /// The run's file.
        file: String,
        /// Line, from 1, where it is listed first.
        first_line: usize,
    },
    /// A handle without the curve that it is a share of.
    #[error("{quantity} is a share of the effort curve, but {train_file} has no {key}")]
    NoEffortCurve {
        /// The mapped quantity.
        quantity: &'static str,
        /// The train's file.
        train_file: String,
        /// The key that would declare the curve.
        key: &'static str,
    },
    /// A run's file without a header line.
    #[error("expected a header line with the columns' names, found an empty file")]
    NoHeader,
    /// Fewer lines in a run's file than are passed over.
    #[error(
        "skip_rows = {skip_rows}: expected lines above the names, but the file has {lines} lines"
    )]
    NothingBelow {
        /// Lines that are passed over.
        skip_rows: usize,
        /// Lines that the file has.
        lines: usize,
    },
    /// Numbers where a line of units should stand.
    #[error(
        "units_row = true: expected units below the names, found the number {found} in column \
         '{column}'"
    )]
    NoUnits {
        /// The column's name.
        column: String,
        /// What stands there.
        found: String,
    },
    /// A run's file without rows.
    #[error("expected rows of values below the header, found none")]
    NoRows,
    /// No row of a run has a value of a quantity without which there is no run.
    #[error("column '{column}': expected values of {quantity}, found none in {rows} rows")]
    NoValues {
        /// The quantity.
        quantity: Quantity,
        /// The column's name.
        column: String,
        /// Number of rows.
        rows: usize,
    },
    /// All rows of a run have one time.
    #[error("column '{column}': expected times that grow, found {time_s} s in all {rows} rows")]
    OneTime {
        /// The column's name.
        column: String,
        /// The time in s.
        time_s: f64,
        /// Number of rows.
        rows: usize,
    },
    /// The header has one column and another delimiter in it.
    #[error(
        "expected columns separated by {expected:?}, found {found:?} in the header: set \
         delimiter = \"{}\" in [dataset]", found.escape_default()
    )]
    OtherDelimiter {
        /// The declared delimiter.
        expected: char,
        /// What the header has instead.
        found: char,
    },
    /// A mapped column occurs more than once.
    #[error("column '{column}' occurs {count} times in the header")]
    RepeatedColumn {
        /// The column's name.
        column: String,
        /// How often it occurs.
        count: usize,
    },
    /// A cell that is neither empty nor a number.
    #[error("column '{column}': expected a number or an empty cell, got '{text}'{hint}")]
    NotANumber {
        /// The column's name.
        column: String,
        /// The cell's text.
        text: String,
        /// What may be the matter; empty or starting with a separator.
        hint: String,
    },
    /// A cell that is neither empty nor a time in the declared format.
    #[error(
        "column '{column}': expected a time as {expected} (format = \"{format}\"), got '{text}'{hint}"
    )]
    NotATime {
        /// The column's name.
        column: String,
        /// The declared format.
        format: String,
        /// What a time looks like in it.
        expected: String,
        /// The cell's text.
        text: String,
        /// What may be the matter; empty or starting with a separator.
        hint: String,
    },
    /// A row with more cells than the header.
    #[error("{found} cells, but the header has {expected} columns{hint}")]
    TooManyCells {
        /// Number of columns in the header.
        expected: usize,
        /// Number of cells in the row.
        found: usize,
        /// What may be the matter; empty or starting with a separator.
        hint: &'static str,
    },
    /// A quoted cell that swallows lines.
    #[error("a quoted cell runs over the end of the line: is a quote unclosed?")]
    UnclosedQuote,
}
