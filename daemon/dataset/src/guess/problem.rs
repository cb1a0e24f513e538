//! Why nothing can be guessed of a recording.

use crate::{DatasetError, Problem, Quantity, SourcePosition};

/// Why nothing can be guessed of a recording, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct GuessError {
    /// File and line.
    pub place: SourcePosition,
    /// What is wrong there.
    pub problem: Box<GuessProblem>,
}

/// What stands in the way of a guess.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GuessProblem {
    /// The file is none that a dataset can have.
    #[error("{0}")]
    File(Box<Problem>),
    /// The first line has no two columns.
    #[error(
        "expected names of columns separated by a comma, semicolon, tab or |, found only '{found}'"
    )]
    OneColumn {
        /// What the line holds.
        found: String,
    },
    /// The first line holds numbers.
    #[error("expected names of columns, found '{found}': write the names into a line above")]
    NoNames {
        /// Its first cell.
        found: String,
    },
    /// The names are fewer than the values below them.
    #[error(
        "expected names of columns, found {found} cells above rows of {usual}: write a name for \
         every column"
    )]
    FewNames {
        /// Cells of the line with the names.
        found: usize,
        /// Cells of most rows.
        usual: usize,
    },
    /// A file of another layout than the first.
    #[error(
        "{what} is {found}, but {expected} in {first}: files of one dataset are laid out alike"
    )]
    OtherLayout {
        /// What differs.
        what: &'static str,
        /// What it is here.
        found: String,
        /// What it is in the first file.
        expected: String,
        /// The first file.
        first: String,
    },
    /// No column for a quantity that every dataset needs.
    #[error("no column was recognised as {quantity}{}; the columns: {columns}", because(reasons))]
    Missing {
        /// The quantity.
        quantity: Quantity,
        /// Columns that come near, each with what speaks against it.
        reasons: Vec<String>,
        /// Every column.
        columns: String,
    },
    /// A column that was named is not there.
    #[error("no column '{name}' for {quantity}; the columns: {columns}")]
    NoSuchColumn {
        /// The name.
        name: String,
        /// What it was named for.
        quantity: Quantity,
        /// Every column.
        columns: String,
    },
    /// A column that was named cannot hold the quantity.
    #[error("column '{name}' cannot be {quantity}: {reason}")]
    Unfit {
        /// The name.
        name: String,
        /// What it was named for.
        quantity: Quantity,
        /// What speaks against it.
        reason: String,
    },
}

fn because(reasons: &[String]) -> String {
    if reasons.is_empty() { String::new() } else { format!(" ({})", reasons.join("; ")) }
}

impl GuessError {
    /// A problem at a place.
    pub fn new(place: SourcePosition, problem: GuessProblem) -> Self {
        GuessError { place, problem: Box::new(problem) }
    }
}

impl From<DatasetError> for GuessError {
    fn from(error: DatasetError) -> Self {
        GuessError::new(error.place, GuessProblem::File(error.problem))
    }
}
