//! Growth of the work of a survey with the number of passes.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use dynocar_analysis::survey::survey;
use dynocar_tests::simulator::dataset_writer::write_dataset;
use dynocar_tests::simulator::{
    EffectRequest, GnssReceiver, SimulatorSettings, TrainType, simulate,
};
use dynocar_workshop::survey::read::{recordings, vehicle};

use crate::ending::until_due;
use crate::output::{BenchError, OutputArguments, Record, table};

/// Seconds for each pass of a survey of a simulated line, for growing numbers of passes.
#[derive(Debug, Args)]
pub struct SurveyBenchArguments {
    /// Numbers of passes
    #[arg(long, value_delimiter = ',', default_values_t = [1, 10, 100, 1000])]
    passes: Vec<usize>,
    /// Write the simulated recordings into this folder
    #[arg(long, value_name = "FOLDER")]
    write: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArguments,
}

/// Different recordings behind the passes: more passes repeat them.
const RECORDINGS: usize = 10;
/// Length in s of a recording.
const DURATION_S: f64 = 480.0;

impl SurveyBenchArguments {
    /// Surveys ever more passes of one line.
    ///
    /// # Errors
    ///
    /// When a survey fails or the result cannot be given.
    pub fn run(&self) -> Result<(), BenchError> {
        let settings = SimulatorSettings {
            train_type: Some(TrainType::Metro),
            runs: RECORDINGS,
            holdout_runs: 0,
            duration_s: DURATION_S,
            gnss: Some(GnssReceiver::USUAL),
            ..SimulatorSettings::new(1, EffectRequest::none())
        };
        let folder = tempfile::tempdir()?;
        let raw = self.write.as_deref().unwrap_or(folder.path());
        write_dataset(&simulate(&settings), raw)?;
        let dataset = dynocar::dataset::load(raw)?;
        let (few, vehicle) = (recordings(&dataset), vehicle(&dataset));
        let mut records = Vec::new();
        for &passes in until_due(&self.passes) {
            let raws: Vec<_> = few.iter().cycle().take(passes).cloned().collect();
            let start = Instant::now();
            let surveyed = survey(&raws, &vehicle, None)?;
            let total_s = start.elapsed().as_secs_f64();
            let record = Record::default()
                .with("passes", passes)
                .with("samples", raws.iter().map(|raw| raw.time_s.len()).sum::<usize>())
                .number("line m", surveyed.alignments.growing.length_m(), 0)
                .number("total s", total_s, 2)
                .number("ms a pass", 1e3 * total_s / passes as f64, 1);
            records.push(record);
        }
        self.output.give(&records, || table(&records))
    }
}
