//! The command line: `dynocar convert` and `replay --verify` become this program where Parquet is named, and
//! the daemon's commands read by it.

use std::fs::File;
use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use dynocar::cli::{Failure, carry_out};
use dynocar::output::{OutputError, report_line, require_new};
use dynocar::programs::{PARQUET, called_as};
use dynocar::unpacking::is_parquet;
use dynocar_mcap::convert::{from_dataset, unpack};
use dynocar_recording::cli::{ConvertArguments, VerifyArguments};

use super::reading::write_mcap;
use crate::numbers::{TrainsBy, Wanted, send_columns};
use crate::reading::{Content, read};
use crate::writing::{Written, write_folder};

/// Recordings as Parquet and back.
#[derive(Debug, Parser)]
#[command(name = "dynocar", bin_name = "dynocar", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Report a failure to another program, in this file
    #[arg(long, global = true, hide = true)]
    json: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Convert(ConvertArguments),
    #[command(hide = true)]
    Verify(VerifyArguments),
    #[command(hide = true)]
    Columns(ColumnsArguments),
}

/// Hand over a Parquet file's columns to another program.
#[derive(Debug, Args)]
struct ColumnsArguments {
    /// The file
    file: PathBuf,
    /// A column whose cells are wanted, and the unit of its numbers
    #[arg(long = "column", num_args = 2, value_names = ["NAME", "UNIT"], allow_hyphen_values = true)]
    columns: Vec<String>,
    /// Hand over whose the rows are, by the column of this name, or else by any that names trains
    #[arg(long, num_args = 0..=1, require_equals = true, value_name = "COLUMN")]
    trains: Option<Option<String>>,
}

/// Parses the command line, runs the command, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out(
        called_as(PARQUET),
        |it: &Arguments| it.json.as_deref(),
        |arguments| match &arguments.command {
            Command::Convert(arguments) => convert(arguments),
            Command::Verify(arguments) => verify(arguments),
            Command::Columns(arguments) => hand_over(arguments),
        },
    )
}

fn convert(arguments: &ConvertArguments) -> Result<(), Failure> {
    let ConvertArguments { from, output, train, .. } = arguments;
    require_new(output)?;
    if is_parquet(output) {
        return to_parquet(arguments);
    }
    let content = one(from)?;
    if output.extension().is_some_and(|it| it == "mcap") {
        write_mcap(&content, output).map_err(Failure::work)?;
        if !arguments.quiet {
            report_line(&format!("{}: {} messages", output.display(), content.messages.len()));
        }
        return Ok(());
    }
    let recording = content.into_recording();
    arguments.report(&unpack(&from[0], recording, output, *train, &arguments.model_files())?);
    Ok(())
}

/// The recording, which is one path.
fn one(paths: &[PathBuf]) -> Result<Content, Failure> {
    let [path] = paths else {
        let words = "expected one recording in Parquet";
        return Err(Failure::Input(format!("{}: {words}", paths[0].display())));
    };
    read(path).map_err(Failure::input)
}

fn to_parquet(arguments: &ConvertArguments) -> Result<(), Failure> {
    let ConvertArguments { from, output, .. } = arguments;
    if let Some(it) = from.iter().find(|it| is_parquet(it)) {
        return Err(Failure::Input(format!("{}: it is Parquet already", it.display())));
    }
    let written = match arguments.dataset() {
        None => write_folder(from, output),
        Some(dataset) => {
            // A dataset becomes what a controller would have had recorded.
            let place = tempfile::tempdir().map_err(Failure::work)?;
            let recording = place.path().join("dataset.mcap");
            from_dataset(dataset, &recording)?;
            write_folder(&[recording], output)
        }
    };
    let Written { samples, snapshots, events, left_out, broken } = written?;
    for it in broken {
        report_line(&format!("{}: {it}; `dynocar recover` makes it whole", called_as(PARQUET)));
    }
    if !arguments.quiet {
        let others = match left_out {
            0 => String::new(),
            count => format!("; {count} messages of others have no place in it"),
        };
        let shown = output.display();
        report_line(&format!(
            "{shown}: {samples} samples, {snapshots} snapshots, {events} events{others}"
        ));
    }
    Ok(())
}

fn verify(arguments: &VerifyArguments) -> Result<(), Failure> {
    arguments.verify(&one(&arguments.recording)?.into_recording())
}

fn hand_over(arguments: &ColumnsArguments) -> Result<(), Failure> {
    let wanted = |pair: &[String]| Wanted { column: pair[0].clone(), unit: pair[1].clone() };
    let wanted: Vec<Wanted> = arguments.columns.chunks(2).map(wanted).collect();
    let trains = arguments.trains.clone();
    let trains = trains.map(|it| it.map_or(TrainsBy::AnyName, TrainsBy::Name));
    // As a file it takes whole blocks at once.
    let output = std::io::stdout().as_fd().try_clone_to_owned();
    let output = output.map_err(OutputError::StandardOutput)?;
    // Whoever calls has named the file.
    let handed_over = send_columns(&arguments.file, &wanted, trains.as_ref(), File::from(output))
        .map_err(|error| Failure::Input(error.problem.to_string()))?;
    match handed_over {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(OutputError::StandardOutput(error).into())
        }
        _ => Ok(()),
    }
}
