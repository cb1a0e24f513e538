//! `dynocar run`: the daemon.

use std::io::IsTerminal;
use std::path::PathBuf;

use clap::Args;
use tracing_subscriber::EnvFilter;

use super::Failure;
use crate::config::{DaemonConfig, LogFormat};
use crate::run::{RunError, run};

/// Serve trains: read their samples, estimate, publish snapshots.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// The daemon's configuration
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
}

/// Runs the daemon until it is asked to end, or its terminal is gone.
///
/// # Errors
///
/// A wrong configuration is an input failure, anything later a failure of the work.
pub fn execute(arguments: &RunArguments) -> Result<(), Failure> {
    let config = DaemonConfig::load(&arguments.config)?;
    start_log(&config)?;
    run(&config).map_err(|error| match error {
        RunError::Setting(_) => Failure::Input(format!("{}: {error}", arguments.config.display())),
        error => Failure::Work(error.to_string()),
    })
}

/// Starts the log as the configuration wants it.
pub(super) fn start_log(config: &DaemonConfig) -> Result<(), Failure> {
    let filter = EnvFilter::try_new(&config.log).map_err(|error| {
        let log = &config.log;
        Failure::Input(format!("daemon.log = {log:?}: expected a level as info or debug: {error}"))
    })?;
    let log = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        // A log that cannot be written is told nowhere, and ends no daemon.
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal());
    match config.log_format {
        LogFormat::Text => log.with_target(false).init(),
        LogFormat::Json => log.json().init(),
    }
    Ok(())
}
