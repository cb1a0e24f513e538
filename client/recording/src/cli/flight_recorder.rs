//! `dynocar flight-recorder` and `dynocar keep`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use dynocar::cli::Failure;
use dynocar::output::report_line;

use super::record::{MIB, SyncArguments, WantedArguments, run};
use crate::record::{Keeping, Rotation, Settings, request_keeping};

/// The name by which the ring's files begin.
const RING: &str = "ring.mcap";
/// Files that a ring is made of, by age: with fewer, more is removed at once than need be.
const PARTS: u32 = 60;
/// The shortest and the longest time that a file of the ring takes.
const PART: [Duration; 2] = [Duration::from_secs(10), Duration::from_secs(600)];

/// Keep the last hours in a ring on disk, and for good what lies around a suspicion, a fault or a request.
#[derive(Debug, Args)]
pub struct FlightRecorderArguments {
    /// The ring's folder, made where it is not there; what is kept lies below it in `kept`
    folder: PathBuf,
    /// Hours that the ring reaches back
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = hours)]
    hours: f64,
    /// The most MiB that the ring takes; the oldest go
    #[arg(long, value_name = "N", default_value_t = 4096,
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    ring_mib: u64,
    /// The most MiB that all that is kept takes; then nothing more is kept, and a line says so
    #[arg(long, value_name = "N", default_value_t = 4096,
          value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    kept_mib: u64,
    /// Seconds kept before a suspicion, a fault or a request
    #[arg(long, value_name = "S", default_value_t = 300,
          value_parser = clap::value_parser!(u64).range(1..=86_400))]
    before_s: u64,
    /// Seconds kept after it
    #[arg(long, value_name = "S", default_value_t = 300,
          value_parser = clap::value_parser!(u64).range(1..=86_400))]
    after_s: u64,
    #[command(flatten)]
    sync: SyncArguments,
    #[command(flatten)]
    wanted: WantedArguments,
    /// The daemon's configuration to attach; by default the one that its command line names
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// Ask a flight recorder to keep this moment for good.
#[derive(Debug, Args)]
pub struct KeepArguments {
    /// The ring's folder
    folder: PathBuf,
    /// Why, in words
    #[arg(short, long, value_name = "TEXT", default_value = "asked for")]
    reason: String,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|it| (0.01..=10_000.0).contains(it));
    hours.ok_or_else(|| "expected hours from 0.01 to 10000".to_owned())
}

/// Records until it is asked to end.
///
/// # Errors
///
/// A folder in which another recorder writes is an input failure.
pub fn execute(arguments: &FlightRecorderArguments) -> Result<(), Failure> {
    let age = Duration::from_secs_f64(3600.0 * arguments.hours);
    let bytes = arguments.ring_mib * MIB;
    run(&Settings {
        wanted: arguments.wanted.wanted()?,
        output: arguments.folder.join(RING),
        rotation: Rotation {
            bytes: Some((bytes / u64::from(PARTS)).max(MIB / 4)),
            age: Some((age / PARTS).clamp(PART[0], PART[1])),
            keep_bytes: Some(bytes),
            keep_age: Some(age),
        },
        sync: arguments.sync.every(),
        configuration: arguments.config.clone(),
        keeping: Some(Keeping {
            before: Duration::from_secs(arguments.before_s),
            after: Duration::from_secs(arguments.after_s),
            most_bytes: arguments.kept_mib * MIB,
        }),
    })
}

/// Asks the recorder that writes into the folder.
///
/// # Errors
///
/// When there is none.
pub fn execute_keep(arguments: &KeepArguments) -> Result<(), Failure> {
    let shown = arguments.folder.display();
    match request_keeping(&arguments.folder, &arguments.reason) {
        Ok(true) => {
            report_line(&format!("asked: what lies around this moment is kept in {shown}/kept"));
            Ok(())
        }
        Ok(false) => Err(Failure::Work(format!("{shown}: no flight recorder writes into it"))),
        Err(error) => Err(Failure::Input(format!("{shown}: {error}"))),
    }
}
