//! The command line of `dynocar live`.

use std::net::{IpAddr, SocketAddr};
use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use dynocar::cli::{Failure, carry_out};
use dynocar::ending;
use dynocar_recording::cli::WantedArguments;

use crate::live::{LiveSettings, live};

/// Serve samples, snapshots and events live to Foxglove or Lichtblick.
///
/// By the Foxglove WebSocket protocol, with the topics and messages of a recording. Trains and daemons
/// may come and go. It is one more reader of the trains' channels, which nobody waits for.
#[derive(Debug, Parser)]
#[command(name = "dynocar live", bin_name = "dynocar live", version)]
struct Arguments {
    #[command(flatten)]
    wanted: WantedArguments,
    /// Samples a second that viewers get of each train; 0 for every one
    #[arg(long, value_name = "HZ", default_value_t = 50,
          value_parser = clap::value_parser!(u32).range(0..=100_000))]
    samples_hz: u32,
    /// The address to serve on. Nothing is encrypted and nobody is asked who they are: name another
    /// than the default only where all who reach it may see everything
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: IpAddr,
    /// The port; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = 8765)]
    port: u16,
}

/// Returns the command line of `dynocar live`.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Parses the command line, serves until asked to end, reports a failure on standard error.
pub fn main() -> ExitCode {
    carry_out("dynocar live", execute)
}

fn execute(arguments: &Arguments) -> Result<(), Failure> {
    let settings = LiveSettings {
        wanted: arguments.wanted.wanted()?,
        samples_hz: arguments.samples_hz,
        address: SocketAddr::new(arguments.host, arguments.port),
    };
    let stop = ending::flag().map_err(Failure::work)?;
    live(&settings, &stop).map_err(Failure::work)
}
