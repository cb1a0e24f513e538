//! A format of recorded runs, and the contents of a run's file: rows of text, or columns of numbers.

use std::path::Path;

use super::error::FileProblem;

/// A format of recorded runs.
#[derive(Debug)]
pub struct Format {
    /// Its name in messages.
    pub name: &'static str,
    /// The extension of its files.
    pub extension: &'static str,
    /// The first bytes of its files, with the words for a file that has them and another extension; `None` for text.
    pub mark: Option<(&'static [u8], &'static str)>,
    /// How a run of a dataset is read; `None` where a run cannot have this format.
    pub run: Option<RunReading>,
    /// Kind of path that leads to a recording; `None` where a recording cannot have this format.
    pub recording: Option<RecordingPath>,
}

/// How a run of a dataset is read.
#[derive(Debug)]
pub enum RunReading {
    /// As text; the function returns the rows of its text as CSV, line for line.
    Text(fn(String) -> Result<String, String>),
    /// By a library, which only the workshop links.
    Library,
}

/// Kind of path that leads to a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordingPath {
    /// A file.
    File,
    /// A file, or a folder with the extension of the format.
    FileOrFolder,
}

impl Format {
    /// Returns a format of text for the runs of a dataset; `as_csv` returns the rows of its text as CSV, line for line.
    pub const fn of_text(
        name: &'static str,
        extension: &'static str,
        as_csv: fn(String) -> Result<String, String>,
    ) -> Self {
        Format { name, extension, mark: None, run: Some(RunReading::Text(as_csv)), recording: None }
    }

    /// Returns true for a path with the extension of the format.
    pub fn is_of(&self, path: impl AsRef<Path>) -> bool {
        path.as_ref().extension().is_some_and(|it| it == self.extension)
    }

    /// Returns true where a library reads the runs.
    pub fn needs_library(&self) -> bool {
        matches!(self.run, Some(RunReading::Library))
    }

    /// Returns the rows of a run's text as CSV.
    ///
    /// # Errors
    ///
    /// When the text has another format, or the format is not text.
    pub fn rows(&self, text: String) -> Result<String, FileProblem> {
        match self.run {
            Some(RunReading::Text(as_csv)) => as_csv(text).map_err(FileProblem::Table),
            _ => Err(self.is_not_text()),
        }
    }

    /// Returns the error of a run in a format that only the workshop reads.
    pub fn is_not_text(&self) -> FileProblem {
        FileProblem::Table(format!("it is {}, which the workshop reads", self.name))
    }
}

/// Contents of a run's file.
#[derive(Clone, Debug, PartialEq)]
pub enum RunContent {
    /// Rows of text, in the layout of the manifest.
    Text(String),
    /// The columns of a file that is no text.
    Columns(RunColumns),
}

/// The columns of a run's file that is no text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunColumns {
    /// All columns. Where a mapped one is missing, no column has values.
    pub columns: Vec<RunColumn>,
    /// The column that names the train of each row.
    pub trains: Option<TrainColumn>,
}

/// A column of a run's file that is no text.
#[derive(Clone, Debug, PartialEq)]
pub struct RunColumn {
    /// Its name.
    pub name: String,
    /// The numbers of a mapped column, with times in their declared unit; `NaN` where missing.
    pub values: Option<Vec<f64>>,
}

/// The column of a run's file that names the train of each row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainColumn {
    /// Its name.
    pub name: String,
    /// The trains' names.
    pub trains: Vec<String>,
    /// The place of each row's train among them; `NaN` where none is named.
    pub rows: Vec<f64>,
}

/// Returns the place of a train among those that are known, to which a new one is added.
pub fn place_of(train: &str, trains: &mut Vec<String>) -> usize {
    let known = trains.iter().position(|it| it == train);
    known.unwrap_or_else(|| {
        trains.push(train.to_owned());
        trains.len() - 1
    })
}

impl TrainColumn {
    /// Returns the name of each row's train, empty where none is named.
    pub fn cells(&self) -> impl Iterator<Item = &str> {
        let name = |&place: &f64| self.trains.get(place as usize).filter(|_| !place.is_nan());
        self.rows.iter().map(move |place| name(place).map_or("", String::as_str))
    }
}
