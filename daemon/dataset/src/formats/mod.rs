//! The formats of recorded runs: every place that distinguishes formats reads this table.
//!
//! The daemon reads the formats of text. The workshop also links the libraries of the others.

use std::path::Path;

use super::format::{Format, RecordingPath, RunReading};

/// All formats.
pub static FORMATS: &[&Format] = &[&CSV, &PARQUET, &MCAP];

/// Rows of text, in the layout that the dataset declares; also of files with an unknown extension.
pub static CSV: Format = Format::of_text("CSV", "csv", Ok);

/// Tables of any program as runs, and recordings that `dynocar convert` has written.
pub static PARQUET: Format = Format {
    name: "Parquet",
    extension: "parquet",
    mark: Some((b"PAR1", "a Parquet file: give it a name that ends with .parquet")),
    run: Some(RunReading::Library),
    recording: Some(RecordingPath::FileOrFolder),
};

/// Recordings of samples, snapshots and events, as `dynocar record` writes them.
pub static MCAP: Format = Format {
    name: "MCAP",
    extension: "mcap",
    mark: Some((
        b"\x89MCAP0",
        "an MCAP recording: dynocar check reads it as it is, under a name that ends with .mcap",
    )),
    run: None,
    recording: Some(RecordingPath::File),
};

/// Returns the format of a run's file by its extension, CSV for an unknown one.
pub fn of_run(path: impl AsRef<Path>) -> &'static Format {
    let path = path.as_ref();
    FORMATS.iter().find(|it| it.run.is_some() && it.is_of(path)).unwrap_or(&&CSV)
}

/// Returns the format of a recording by its extension; `None` where no recording has this extension.
pub fn of_recording(path: &Path) -> Option<&'static Format> {
    FORMATS.iter().find(|it| it.recording.is_some() && it.is_of(path)).copied()
}
