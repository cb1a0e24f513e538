//! `dynocar run`: the daemon. `dynocar demo`: the main job, with no arguments.

use std::path::PathBuf;

use clap::Args;
use dynocar_client::ChannelError;
use tracing::warn;
use tracing_subscriber::prelude::*;

use super::Failure;
use crate::config::{DaemonConfig, LogFormat, RootError};
use crate::demo::{DemoError, play};
use crate::log::{Log, Queue};
use crate::output::{give, require_file};
use crate::run::{RunError, run};

/// Run the daemon: read samples, estimate, publish snapshots.
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
    let log = start_log(&config)?;
    for (train, diagnostic) in config.diagnostics() {
        warn!(train = train.0, "{}", diagnostic.labelled());
    }
    let ended = run(&config);
    drop(log);
    ended.map_err(|error| match error {
        RunError::Root(RootError::OfEnvironment(ChannelError::RootLength { .. })) => {
            Failure::input(error)
        }
        error => Failure::work(error),
    })
}

/// Starts the log as the configuration wants it.
///
/// # Errors
///
/// When the system gives no thread.
pub fn start_log(config: &DaemonConfig) -> Result<Log, Failure> {
    // Each pipeline of each train says its status at the start and its counts at the end.
    let burst = 2 * config.trains.len() * config.pipelines.len();
    let queue = Queue::start(burst).map_err(Failure::work)?;
    let log = tracing_subscriber::fmt::layer()
        .with_writer(queue.clone())
        .with_ansi(false)
        // A log that cannot be written is reported nowhere, and ends no daemon.
        .log_internal_errors(false);
    let log = match config.process.log_format {
        LogFormat::Text => log.with_target(false).boxed(),
        LogFormat::Json => log.json().boxed(),
    };
    // One that is not understood is refused with the configuration.
    let filter = config.process.log_filter().unwrap_or_default();
    tracing_subscriber::registry().with(filter).with(log).init();
    Ok(Log(queue))
}

/// Show controller, daemon and client at work on recorded runs, in 20 seconds.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// How many times as fast as recorded
    #[arg(long, default_value_t = 400.0, value_name = "K")]
    rate: f64,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// Plays the demo.
///
/// # Errors
///
/// A rate out of range is an input failure; everything else a failure of the work.
pub fn execute_demo(arguments: &DemoArguments) -> Result<(), Failure> {
    let rate = arguments.rate;
    if !(1.0..=1000.0).contains(&rate) {
        return Err(Failure::Input(format!("--rate {rate}: expected 1 to 1000")));
    }
    if let Some(file) = &arguments.json {
        require_file(file, "{")?;
    }
    let summary = match play(rate) {
        Err(DemoError::Interrupted) => return Err(Failure::Verdict(130)),
        played => played.map_err(Failure::work)?,
    };
    let answer = summary.answer();
    give(arguments.json.as_deref(), &answer, || summary.text())?;
    match answer.samples.lost {
        0 => Ok(()),
        lost => Err(Failure::Work(format!(
            "{lost} samples were lost at {rate} times the recorded rate"
        ))),
    }
}
