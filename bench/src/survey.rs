//! How the work of a survey grows with the number of passes.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use dynocar_analysis::survey::survey;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    EffectRequest, GnssReceiver, SimulatorSettings, TrainType, simulate,
};
use dynocar_workshop::survey::read::{recordings, vehicle};
use serde::Serialize;

use crate::output::give;

/// Seconds for each pass of a survey of a simulated line, for growing numbers of passes.
#[derive(Debug, Args)]
pub struct SurveyArguments {
    /// Numbers of passes
    #[arg(long, value_delimiter = ',', default_values_t = [1, 10, 100, 1000])]
    passes: Vec<usize>,
    /// Write the simulated recordings into this folder
    #[arg(long, value_name = "FOLDER")]
    write: Option<PathBuf>,
    /// Write the result for machines; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Different recordings behind the passes: more passes repeat them.
const RECORDINGS: usize = 10;
/// Length in s of a recording.
const DURATION_S: f64 = 480.0;

/// What was measured.
#[derive(Serialize)]
struct Report {
    rows: Vec<Row>,
}

/// One number of passes.
#[derive(Serialize)]
struct Row {
    passes: usize,
    samples: usize,
    line_m: f64,
    total_s: f64,
    pass_ms: f64,
}

/// Surveys ever more passes of one line.
///
/// # Errors
///
/// A text and an exit status when a survey fails or the result cannot be given.
pub fn run(arguments: &SurveyArguments) -> Result<(), (String, u8)> {
    let failed = |error: &dyn std::fmt::Display| (error.to_string(), 1);
    let settings = SimulatorSettings {
        train_type: Some(TrainType::Metro),
        runs: RECORDINGS,
        holdout_runs: 0,
        duration_s: DURATION_S,
        gnss: Some(GnssReceiver::USUAL),
        ..SimulatorSettings::new(1, EffectRequest::none())
    };
    let folder = tempfile::tempdir().map_err(|error| failed(&error))?;
    let raw = arguments.write.as_deref().unwrap_or(folder.path());
    write_dataset(&simulate(&settings), raw).map_err(|error| failed(&error))?;
    let dataset = dynocar::dataset::load(raw).map_err(|error| failed(&error))?;
    let (few, vehicle) = (recordings(&dataset), vehicle(&dataset));
    let mut rows = Vec::new();
    for &passes in &arguments.passes {
        let raws: Vec<_> = few.iter().cycle().take(passes).cloned().collect();
        let start = Instant::now();
        let surveyed = survey(&raws, &vehicle, None).map_err(|error| failed(&error))?;
        let total_s = start.elapsed().as_secs_f64();
        rows.push(Row {
            passes,
            samples: raws.iter().map(|raw| raw.time_s.len()).sum(),
            line_m: surveyed.alignments.growing.length_m(),
            total_s,
            pass_ms: 1e3 * total_s / passes as f64,
        });
    }
    let report = Report { rows };
    give(&arguments.json, &report, || table(&report))
}

fn table(report: &Report) -> String {
    let mut text = String::from("passes   samples   line, m   total, s   ms a pass\n");
    for Row { passes, samples, line_m, total_s, pass_ms } in &report.rows {
        text += &format!("{passes:>6}{samples:>10}{line_m:>10.0}{total_s:>11.2}{pass_ms:>12.1}\n");
    }
    text
}
