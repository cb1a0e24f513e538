//! How the time of an explanation grows with the data: more runs, and longer ones.

use std::time::Instant;

use serde::Serialize;

use super::case::{explained, read};
use super::scenario::Scenario;
use dynocar_tests::simulator::{SimulatorSettings, simulate};

/// The data are made so many times more.
const FACTORS: [usize; 3] = [1, 4, 16];

/// One size of data.
#[derive(Clone, Debug, Serialize)]
pub struct Size {
    /// What grows: `runs` or `duration`.
    pub axis: &'static str,
    /// How many times more data than at first.
    pub factor: usize,
    /// Runs of a dataset.
    pub runs: usize,
    /// Length in s that a run aims at.
    pub duration_s: f64,
    /// Samples of all datasets together.
    pub samples: usize,
    /// Time in s that explaining them takes, all together.
    pub seconds: f64,
}

impl Size {
    /// Time in µs for each sample.
    pub fn per_sample_us(&self) -> f64 {
        1e6 * self.seconds / self.samples as f64
    }
}

/// Explains one dataset of each scenario at every size, one after the other on one thread.
pub fn measure(scenarios: &[Scenario], seed: u64, tell: &dyn Fn(&Size)) -> Vec<Size> {
    let mut sizes = Vec::new();
    for axis in ["runs", "duration"] {
        for factor in FACTORS {
            let (mut samples, mut seconds) = (0, 0.0);
            let settings = |scenario: Scenario| grown(scenario.settings(seed), axis, factor);
            for &scenario in scenarios {
                let dataset = read(&simulate(&settings(scenario)));
                samples += dataset.runs.iter().map(|run| run.samples.len()).sum::<usize>();
                let since = Instant::now();
                explained(&dataset);
                seconds += since.elapsed().as_secs_f64();
            }
            let SimulatorSettings { runs, duration_s, .. } = settings(Scenario::PoorNull);
            let size = Size { axis, factor, runs, duration_s, samples, seconds };
            tell(&size);
            sizes.push(size);
        }
    }
    sizes
}

fn grown(settings: SimulatorSettings, axis: &str, factor: usize) -> SimulatorSettings {
    match axis {
        "runs" => SimulatorSettings {
            runs: factor * settings.runs,
            holdout_runs: factor * settings.holdout_runs,
            ..settings
        },
        _ => SimulatorSettings { duration_s: factor as f64 * settings.duration_s, ..settings },
    }
}

/// The sizes as a table for people.
pub fn table(sizes: &[Size]) -> String {
    let mut text =
        String::from("grows     times  runs  each s    samples     time s  us/sample  to first\n");
    for size in sizes {
        let first = sizes.iter().find(|other| other.axis == size.axis).unwrap_or(size);
        text += &format!(
            "{:9} {:5} {:5} {:7.0} {:10} {:10.2} {:10.1} {:9.2}\n",
            size.axis,
            size.factor,
            size.runs,
            size.duration_s,
            size.samples,
            size.seconds,
            size.per_sample_us(),
            size.per_sample_us() / first.per_sample_us()
        );
    }
    text
}
