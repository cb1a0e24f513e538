//! `dynocar demo`: the main job, with no arguments.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use crate::demo::{DemoError, play};
use crate::output::{give, require_file};

/// Show controller, daemon and client at work on recorded runs, in 20 seconds.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// How many times as fast as recorded
    #[arg(long, default_value_t = 200.0, value_name = "K")]
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
pub fn execute(arguments: &DemoArguments) -> Result<(), Failure> {
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
