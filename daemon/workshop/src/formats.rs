//! The libraries of the formats that are not text: the workshop's readers and writers of their files.
//!
//! A recording has the same contents in every format. So each library exchanges its recordings with MCAP.

use std::path::{Path, PathBuf};

use dynocar::cli::Failure;
use dynocar_analysis::dataset::format::{Format, RecordingPath};
use dynocar_analysis::dataset::formats::{MCAP, PARQUET};
use dynocar_analysis::dataset::text_layout::TrainRows;
use dynocar_analysis::dataset::{ColumnMapping, FileProblem, RunColumns};
use dynocar_mcap::error::CopyError;
use dynocar_mcap::recording::Recording;
use dynocar_parquet::columns::{columns_of, columns_of_bytes};
use dynocar_parquet::reading::{self, ParquetContent, write_mcap};
use dynocar_parquet::writing::{Written, write_folder};

/// A library of a format.
pub struct Library {
    /// The format.
    pub format: &'static Format,
    /// Reads the mapped columns of a run, and the train of each row; `None` where a run cannot have this format.
    pub run: Option<RunReader>,
    /// Reads the samples and the attached files of a recording, of one that rotated its files in order.
    pub samples: fn(&[PathBuf]) -> Result<Recording, String>,
    /// Reads a recording with all of its messages.
    pub whole: fn(&[PathBuf]) -> Result<Recording, String>,
    /// Exchanges recordings with MCAP; `None` for MCAP itself.
    pub exchange: Option<McapExchange>,
}

/// Reads the mapped columns of a run, and the train of each row.
pub type RunReader = fn(RunFile, &[ColumnMapping], &TrainRows) -> Result<RunColumns, FileProblem>;

/// The file of a run.
pub enum RunFile<'f> {
    /// On disk.
    OnDisk(&'f Path),
    /// Attached to a recording.
    Attached(&'f [u8]),
}

/// How recordings are exchanged with MCAP.
pub struct McapExchange {
    /// Writes recordings in MCAP as a new recording of the format.
    pub from_mcap: fn(&[PathBuf], &Path) -> Result<Written, CopyError>,
    /// Writes a recording of the format as a new file of MCAP; returns the number of messages.
    pub to_mcap: fn(&[PathBuf], &Path) -> Result<usize, Failure>,
}

/// The libraries of all formats that are not text. The first one reads a recording with an unknown extension.
static LIBRARIES: [Library; 2] = [
    Library {
        format: &MCAP,
        run: None,
        samples: |paths| Recording::of_samples(paths).map_err(|error| error.to_string()),
        whole: |paths| Recording::load_all(paths).map_err(|error| error.to_string()),
        exchange: None,
    },
    Library {
        format: &PARQUET,
        run: Some(|file, mappings, train_rows| {
            let columns = match file {
                RunFile::OnDisk(path) => columns_of(path, mappings, train_rows),
                RunFile::Attached(bytes) => columns_of_bytes(bytes.into(), mappings, train_rows),
            };
            columns.map_err(|problem| FileProblem::Table(problem.to_string()))
        }),
        samples: |paths| parquet(paths).map(ParquetContent::into_recording),
        whole: |paths| parquet(paths).map(ParquetContent::into_recording),
        exchange: Some(McapExchange {
            from_mcap: write_folder,
            to_mcap: |paths, output| {
                let content = parquet(paths).map_err(Failure::Input)?;
                write_mcap(&content, output).map_err(Failure::work)?;
                Ok(content.messages.len())
            },
        }),
    },
];

/// Reads a recording in Parquet, which is one path.
fn parquet(paths: &[PathBuf]) -> Result<ParquetContent, String> {
    let [path] = paths else {
        return Err(format!("{}: expected one recording in Parquet", paths[0].display()));
    };
    reading::read(path).map_err(|error| error.to_string())
}

/// Returns the reader of a run's file; `None` where the file is text.
pub fn run_reader(path: impl AsRef<Path>) -> Option<RunReader> {
    LIBRARIES.iter().find(|it| it.format.is_of(&path)).and_then(|it| it.run)
}

/// Returns the library of a recording's extension.
pub fn of_extension(path: &Path) -> Option<&'static Library> {
    LIBRARIES.iter().find(|it| it.format.is_of(path))
}

/// Returns the library that reads the files of a recording: the first one that is exchanged with MCAP, else MCAP.
pub fn of_recording(paths: &[PathBuf]) -> &'static Library {
    let mut known = paths.iter().filter_map(|it| of_extension(it));
    known.find(|it| it.exchange.is_some()).unwrap_or(&LIBRARIES[0])
}

/// Returns true where a recording lies at a path.
pub fn is_recording(path: &Path) -> bool {
    match of_extension(path).and_then(|it| it.format.recording) {
        Some(RecordingPath::File) => path.is_file(),
        Some(RecordingPath::FileOrFolder) => path.exists(),
        None => false,
    }
}
