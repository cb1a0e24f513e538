//! The formats of recorded runs: every place that distinguishes formats reads this table.
//!
//! The daemon reads the formats of text. The workshop also links the libraries of the others.

use std::path::Path;

use super::format::{Format, RecordingPath, RunReading};

/// All formats.
pub static FORMATS: &[&Format] = &[&CSV, &PARQUET, &MCAP];

/// Rows of text, in the layout that the dataset declares; also of files with an unknown extension.
pub static CSV: Format = Format::of_text("CSV", "csv", rows_of_csv);

/// Refuses JSON, whose marks would pass for those between cells.
fn rows_of_csv(text: String) -> Result<String, String> {
    let mut letters = text.trim_start_matches('\u{feff}').chars().filter(|it| !it.is_whitespace());
    let is_json = match [letters.next(), letters.next()] {
        [Some('{'), next] => matches!(next, Some('"' | '}')),
        [Some('['), next] => matches!(next, Some('{' | '[')),
        _ => false,
    };
    match is_json {
        false => Ok(text),
        true => Err("expected rows of CSV, found JSON: write a row of names, and below it a row of values for each record"
            .into()),
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_no_csv() {
        for json in ["{\"t\": 0.0}\n{\"t\": 1.0}\n", " [\n {\"t\": 0.0}]", "[[0.0, 1.0]]", "{}"] {
            let refused = CSV.rows(json.into()).unwrap_err().to_string();
            assert!(refused.contains("found JSON"), "{refused}");
        }
        for csv in ["t,v\n0,1\n", "[s],[m/s]\n0,1\n", "\"t\",\"v\"\n0,1\n", ""] {
            assert!(CSV.rows(csv.into()).is_ok(), "{csv}");
        }
    }
}
