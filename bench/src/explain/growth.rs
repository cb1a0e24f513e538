//! Growth of the time of an explanation with the number and length of its runs.

use std::time::Instant;

use dynocar::output::report_line;
use dynocar_tests::simulator::{SimulatorSettings, simulate};

use super::family::{explained, read};
use super::scenario::{ExplainScenario, ExplainWorld};
use crate::ending::until_due;
use crate::output::Record;

/// Factors by which the data are multiplied.
const FACTORS: [usize; 3] = [1, 4, 16];

/// Explains one dataset of each scenario at every size, one after the other on one thread.
pub fn measure(scenarios: &[ExplainScenario], seed: u64) -> Vec<Record> {
    let mut sizes = Vec::new();
    for axis in ["runs", "duration"] {
        let mut first_us = None;
        for factor in until_due(FACTORS) {
            let grown = |settings: SimulatorSettings| match axis {
                "runs" => SimulatorSettings {
                    runs: factor * settings.runs,
                    holdout_runs: factor * settings.holdout_runs,
                    ..settings
                },
                _ => SimulatorSettings {
                    duration_s: factor as f64 * settings.duration_s,
                    ..settings
                },
            };
            let (mut runs, mut duration_s, mut samples, mut seconds) = (0, 0.0, 0, 0.0);
            for scenario in scenarios {
                let settings = grown(scenario.settings(seed, ExplainWorld::Plain));
                (runs, duration_s) = (settings.runs, settings.duration_s);
                let dataset = read(&simulate(&settings));
                samples += dataset.runs.iter().map(|run| run.samples.len()).sum::<usize>();
                let since = Instant::now();
                explained(&dataset);
                seconds += since.elapsed().as_secs_f64();
            }
            report_line(&format!("{axis} x{factor}: {seconds:.1} s"));
            let sample_us = 1e6 * seconds / samples as f64;
            let first_us = *first_us.get_or_insert(sample_us);
            let size = Record::default()
                .with("grows", axis)
                .with("times", factor)
                .with("runs", runs)
                .number("each s", duration_s, 0)
                .with("samples", samples)
                .number("time s", seconds, 2)
                .number("us/sample", sample_us, 1)
                .number("to first", sample_us / first_us, 2);
            sizes.push(size);
        }
    }
    sizes
}
