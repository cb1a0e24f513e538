//! `dynocar convert`: recordings between MCAP, CSV datasets and Parquet.

use std::path::{Path, PathBuf};

use clap::Args;
use dynocar::cli::Failure;
use dynocar::output::{report_line, require_new};
use dynocar_analysis::dataset::formats::MCAP;
use dynocar_parquet::writing::Written;

use crate::convert::{ModelFiles, Unpacked, unpack};
use crate::dataset::from_dataset;
use crate::formats::{self, McapExchange, is_recording};

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
    let source = formats::of_recording(from);
    let shown = output.display();
    let files = ModelFiles { train: train_file.clone(), track: track_file.clone() };
    if let Some(written_as) = formats::of_extension(output) {
        let format = written_as.format;
        if let Some(own) = from.iter().find(|it| dataset.is_none() && format.is_of(it)) {
            let words = format!("{}: it is {} already", own.display(), format.name);
            return Err(Failure::Input(words));
        }
        if let Some(exchange) = &written_as.exchange {
            return from_mcap(arguments, dataset, exchange);
        }
    }
    let unpacked = match (dataset, &source.exchange) {
        (Some(dataset), _) => {
            let samples = from_dataset(dataset, output)?;
            return arguments.report(&format!("{shown}: {samples} samples"));
        }
        (None, Some(exchange)) if MCAP.is_of(output) => {
            let messages = (exchange.to_mcap)(from, output)?;
            return arguments.report(&format!("{shown}: {messages} messages"));
        }
        (None, _) => {
            let recording = (source.samples)(from).map_err(Failure::Input)?;
            unpack(&from[0], recording, output, *train, &files)?
        }
    };
    let Unpacked { runs, samples, left_out, broken } = unpacked;
    report_broken(broken);
    arguments.report(&format!(
        "{shown}: {runs} runs, {samples} samples; {left_out} snapshots and events have no place in a dataset"
    ))
}

fn is_dataset(path: &Path) -> bool {
    path.extension().is_some_and(|it| it == "toml") || path.is_dir() && !is_recording(path)
}

/// Writes a recording in MCAP, or a dataset, in another format.
fn from_mcap(
    arguments: &ConvertArguments,
    dataset: Option<&PathBuf>,
    exchange: &McapExchange,
) -> Result<(), Failure> {
    let ConvertArguments { from, output, .. } = arguments;
    let written = match dataset {
        None => (exchange.from_mcap)(from, output),
        Some(dataset) => {
            // A dataset first becomes the recording that a controller's samples would have given.
            let place = tempfile::tempdir().map_err(Failure::work)?;
            let recording = place.path().join("dataset.mcap");
            from_dataset(dataset, &recording)?;
            (exchange.from_mcap)(&[recording], output)
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
