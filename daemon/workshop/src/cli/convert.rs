//! `dynocar convert`: recordings between MCAP, CSV datasets and Parquet.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar::cli::Failure;
use dynocar::dataset::is_parquet_path;
use dynocar::output::{report_line, require_new};
use dynocar_parquet::reading::{ParquetContent, read, write_mcap};
use dynocar_parquet::writing::{Written, write_folder};

use crate::convert::{ModelFiles, Unpacked, to_dataset, unpack};
use crate::from_dataset::from_dataset;

/// Convert recordings between MCAP, CSV datasets and Parquet.
#[derive(Debug, Args)]
pub struct ConvertArguments {
    /// A recording, of one that rotated its files in order; or a dataset's folder or dataset.toml
    #[arg(required = true)]
    from: Vec<PathBuf>,
    /// The dataset's folder, or the recording as NAME.mcap or NAME.parquet; it must not be there yet
    #[arg(short, long, value_name = "TO")]
    output: PathBuf,
    /// For a dataset, only this train of the recording
    #[arg(long, value_name = "ID")]
    train: Option<u64>,
    /// The train's file, for a recording to which none is attached
    #[arg(long, value_name = "FILE")]
    train_file: Option<PathBuf>,
    /// The line's file, together with --train-file
    #[arg(long, value_name = "FILE", requires = "train_file")]
    track_file: Option<PathBuf>,
    /// Print only problems
    #[arg(long)]
    quiet: bool,
}

/// Converts, and reports the outcome.
///
/// # Errors
///
/// A recording or dataset that cannot be read is an input failure.
pub fn execute(arguments: &ConvertArguments) -> Result<(), Failure> {
    let ConvertArguments { from, output, train, train_file, track_file, .. } = arguments;
    require_new(output)?;
    let dataset = from.iter().find(|it| is_dataset(it));
    if let (Some(dataset), 2..) = (dataset, from.len()) {
        return Err(Failure::Input(format!("{}: expected no file beside", dataset.display())));
    }
    let parquet = from.iter().find(|it| is_parquet_path(it));
    let shown = output.display();
    let files = ModelFiles { train: train_file.clone(), track: track_file.clone() };
    let unpacked = match (dataset, parquet) {
        (_, Some(it)) if is_parquet_path(output) => {
            return Err(Failure::Input(format!("{}: it is Parquet already", it.display())));
        }
        _ if is_parquet_path(output) => return to_parquet(arguments, dataset),
        (Some(dataset), _) => {
            let samples = from_dataset(dataset, output)?;
            return arguments.report(&format!("{shown}: {samples} samples"));
        }
        (None, Some(_)) => {
            let content = one(from)?;
            if output.extension().is_some_and(|it| it == "mcap") {
                write_mcap(&content, output).map_err(Failure::work)?;
                return arguments.report(&format!("{shown}: {} messages", content.messages.len()));
            }
            unpack(&from[0], content.into_recording(), output, *train, &files)?
        }
        (None, None) => to_dataset(from, output, *train, &files)?,
    };
    let Unpacked { runs, samples, left_out, broken } = unpacked;
    report_broken(broken);
    arguments.report(&format!(
        "{shown}: {runs} runs, {samples} samples; {left_out} snapshots and events have no place in a dataset"
    ))
}

fn is_dataset(path: &Path) -> bool {
    match path.extension().and_then(|it| it.to_str()) {
        Some("toml") => true,
        Some("parquet") => false,
        _ => path.is_dir(),
    }
}

/// Returns the recording in Parquet, which is one path.
///
/// # Errors
///
/// When there are several, or it cannot be read.
pub fn one(paths: &[PathBuf]) -> Result<ParquetContent, Failure> {
    let [path] = paths else {
        let words = "expected one recording in Parquet";
        return Err(Failure::Input(format!("{}: {words}", paths[0].display())));
    };
    read(path).map_err(Failure::input)
}

fn to_parquet(arguments: &ConvertArguments, dataset: Option<&PathBuf>) -> Result<(), Failure> {
    let ConvertArguments { from, output, .. } = arguments;
    let written = match dataset {
        None => write_folder(from, output),
        Some(dataset) => {
            // A dataset first becomes the recording that a controller's samples would have given.
            let place = tempfile::tempdir().map_err(Failure::work)?;
            let recording = place.path().join("dataset.mcap");
            from_dataset(dataset, &recording)?;
            write_folder(&[recording], output)
        }
    };
    let Written { samples, snapshots, events, left_out, broken } = written?;
    report_broken(broken);
    let others = match left_out {
        0 => String::new(),
        count => format!("; {count} messages of others have no place in it"),
    };
    let shown = output.display();
    arguments.report(&format!(
        "{shown}: {samples} samples, {snapshots} snapshots, {events} events{others}"
    ))
}

fn report_broken(broken: impl IntoIterator<Item = String>) {
    for it in broken {
        report_line(&format!("dynocar: {it}; `dynocar recover` makes it whole"));
    }
}

impl ConvertArguments {
    fn report(&self, words: &str) -> Result<(), Failure> {
        if !self.quiet {
            report_line(words);
        }
        Ok(())
    }
}
