//! How the time of an explanation grows with the data: more runs, and longer ones.

use std::time::Instant;

use dynocar::output::report_line;
use serde::Serialize;

use super::case::{explained, read};
use super::scenario::Scenario;
use super::world::World;
use crate::output::{self, Record};
use dynocar_tests::simulator::{SimulatorSettings, simulate};

/// The data are made so many times more.
const FACTORS: [usize; 3] = [1, 4, 16];

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// The number of runs.
    Runs,
    /// Their length.
    Duration,
}

impl Axis {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Axis::Runs => "runs",
            Axis::Duration => "duration",
        }
    }

    fn grown(self, settings: SimulatorSettings, factor: usize) -> SimulatorSettings {
        match self {
            Axis::Runs => SimulatorSettings {
                runs: factor * settings.runs,
                holdout_runs: factor * settings.holdout_runs,
                ..settings
            },
            Axis::Duration => {
                SimulatorSettings { duration_s: factor as f64 * settings.duration_s, ..settings }
            }
        }
    }
}

/// One size of data.
#[derive(Clone, Debug, Serialize)]
pub struct Size {
    /// What grows.
    pub axis: Axis,
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
pub fn measure(scenarios: &[Scenario], seed: u64) -> Vec<Size> {
    let mut sizes = Vec::new();
    for axis in [Axis::Runs, Axis::Duration] {
        for factor in FACTORS {
            let mut size =
                Size { axis, factor, runs: 0, duration_s: 0.0, samples: 0, seconds: 0.0 };
            for scenario in scenarios {
                let settings = axis.grown(scenario.settings(seed, World::Plain), factor);
                (size.runs, size.duration_s) = (settings.runs, settings.duration_s);
                let dataset = read(&simulate(&settings));
                size.samples += dataset.runs.iter().map(|run| run.samples.len()).sum::<usize>();
                let since = Instant::now();
                explained(&dataset);
                size.seconds += since.elapsed().as_secs_f64();
            }
            report_line(&format!("{} x{factor}: {:.1} s", axis.name(), size.seconds));
            sizes.push(size);
        }
    }
    sizes
}

/// The sizes as a table for people.
pub fn table(sizes: &[Size]) -> String {
    let row = |size: &Size| {
        let first = sizes.iter().find(|other| other.axis == size.axis).unwrap_or(size);
        Record::default()
            .with("grows", size.axis.name())
            .with("times", size.factor)
            .with("runs", size.runs)
            .number("each s", size.duration_s, 0)
            .with("samples", size.samples)
            .number("time s", size.seconds, 2)
            .number("us/sample", size.per_sample_us(), 1)
            .number("to first", size.per_sample_us() / first.per_sample_us(), 2)
    };
    output::table(&sizes.iter().map(row).collect::<Vec<_>>())
}
