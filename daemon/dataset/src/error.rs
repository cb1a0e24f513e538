//! Errors of the files that people write, and their places.

use std::fmt::Display;

use strsim::levenshtein;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourcePosition {
    /// The file, as the user would find it.
    pub file: String,
    /// Line in the file, from 1; `None` when the whole file is meant.
    pub line: Option<usize>,
}

impl SourcePosition {
    /// Returns a line, from 1, of a file.
    pub fn line(file: &str, line: usize) -> Self {
        SourcePosition { file: file.into(), line: Some(line) }
    }

    /// Returns a file as a whole.
    pub fn whole(file: &str) -> Self {
        SourcePosition { file: file.into(), line: None }
    }

    /// Returns a problem at this place: the expected value and the found one.
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
    /// Returns the error of a file that was named itself and cannot be read.
    pub fn of(self, label: &str) -> DatasetError {
        let line = match self {
            FileProblem::NotUtf8 { line } | FileProblem::OtherEncoding { line, .. } => Some(line),
            _ => None,
        };
        SourcePosition { file: label.into(), line }.problem(self)
    }
}

/// Remedy for columns of one name.
pub(crate) const RENAME: &str = ": give each column a name of its own there";

/// Returns the words for a name that may not stand in its place.
pub fn unknown<T: Into<String>>(
    what: &str,
    name: &str,
    context: &str,
    names: impl IntoIterator<Item = T>,
) -> String {
    let names: Vec<String> = names.into_iter().map(Into::into).collect();
    let meant = nearest(name, &names).map(|meant| format!("; did you mean '{meant}'?"));
    let choices: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    let (meant, choices) = (meant.unwrap_or_default(), choices.join(", "));
    format!("unknown {what} '{name}'{context}{meant} (choices: {choices})")
}

/// Returns the name that is likely meant by a word: at most a third of the letters differ, or else it is
/// the only name that the word begins.
pub fn nearest<'n>(word: &str, all: &'n [String]) -> Option<&'n str> {
    let word = folded(word);
    let names: Vec<_> = all.iter().map(|name| folded(name)).collect();
    let distances = names.iter().enumerate().map(|(index, name)| (levenshtein(&word, name), index));
    let (distance, index) = distances.min()?;
    let letters = |name: &str| name.chars().count();
    if distance <= letters(&word).max(letters(&names[index])) / 3 {
        return Some(&all[index]);
    }
    let mut begun = (0..names.len()).filter(|&index| names[index].starts_with(&word));
    let only = begun.next().filter(|_| begun.next().is_none() && !word.is_empty());
    only.map(|index| all[index].as_str())
}

/// Returns a name in small letters with one mark between words, since names that differ only there are alike for a
/// guess.
fn folded(name: &str) -> String {
    // A word of any length may come from a file; a name's first letters are enough for a guess.
    let letters = name.chars().take(80).flat_map(char::to_lowercase);
    letters.map(|letter| if letter == '-' || letter == ' ' { '_' } else { letter }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_that_was_meant_is_suggested() {
        let meant = |word: &str, names: &[&str]| {
            let names: Vec<String> = names.iter().map(|&name| name.into()).collect();
            nearest(word, &names).map(ToOwned::to_owned)
        };
        let of = |name: &str| Some(name.to_string());
        let units = ["m/s", "km/h", "mph"];
        assert_eq!(meant("kmh", &units), of("km/h"));
        assert_eq!(meant("KM/H", &units), of("km/h"));
        assert_eq!(meant("furlong", &units), None);
        assert_eq!(meant("v", &["t", "v_kmh"]), of("v_kmh"));
        assert_eq!(meant("v", &["t", "v_kmh", "v_ref"]), None);
        let keys = ["position_reference", "description"];
        assert_eq!(meant("Position-Referance", &keys), of("position_reference"));
    }

    #[test]
    fn choices_are_listed_after_the_suggestion() {
        let shown = unknown("key", "sped", " in [x]", ["speed", "time"]);
        let expected =
            "unknown key 'sped' in [x]; did you mean 'speed'? (choices: 'speed', 'time')";
        assert_eq!(shown, expected);
    }
}
