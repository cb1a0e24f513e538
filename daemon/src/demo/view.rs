//! The live view: one line for each pipeline, a progress bar of the samples; plain lines without a terminal.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use dynocar_client::{Reading, SnapshotReader};
use dynocar_shared::{HALF_95, ParameterSnapshot, PipelineKind};

use dynocar_dataset::Dataset;

use crate::output::report_line;
use crate::redrawn::{Redrawn, bar, can_draw};

/// How often a plain line is written for each pipeline.
const PLAIN_EVERY: Duration = Duration::from_secs(3);

/// Width of the progress bar in characters.
const BAR_LETTERS: usize = 40;

/// Shows the estimates as they come.
pub struct DemoView {
    total: u64,
    /// Drawing on the terminal; `None` without a terminal.
    redrawn: Option<Redrawn>,
    last_plain: Option<Instant>,
}

impl DemoView {
    /// Returns a view of the replay of a dataset with `total` samples.
    pub fn new(dataset: &Dataset, total: u64, rate: f64) -> Self {
        report_line(&format!(
            "{}: {} recorded runs at {rate} times their speed",
            dataset.train.name,
            dataset.runs.len()
        ));
        report_line("controller, daemon and client are three processes; ± is a 95 % interval");
        let redrawn = (std::io::stderr().is_terminal() && can_draw()).then(Redrawn::default);
        DemoView { total, redrawn, last_plain: None }
    }

    /// Shows the newest snapshots of the reader.
    pub fn draw(&mut self, reader: &SnapshotReader, now_ns: i64) {
        match &mut self.redrawn {
            Some(redrawn) => redrawn.draw(&lines(reader, now_ns, self.total)),
            None => {
                if self.last_plain.is_none_or(|last| last.elapsed() >= PLAIN_EVERY) {
                    self.last_plain = Some(Instant::now());
                    self.write_lines(reader, now_ns);
                }
            }
        }
    }

    fn write_lines(&self, reader: &SnapshotReader, now_ns: i64) {
        for reading in reader.readings(now_ns) {
            let percent = 100 * reading.snapshot.sample_sequence / self.total.max(1);
            report_line(&format!("{percent:3} %  {}", describe(&reading)));
        }
    }
}

/// Returns a line for each pipeline, and one for the samples.
fn lines(reader: &SnapshotReader, now_ns: i64, total: u64) -> Vec<String> {
    let done = reader.readings(now_ns).map(|it| it.snapshot.sample_sequence).max().unwrap_or(0);
    let bar = bar(done as f64 / total.max(1) as f64, BAR_LETTERS);
    let pipelines = reader.readings(now_ns).map(|reading| describe(&reading));
    pipelines.chain([format!("{bar} {done}/{total} samples")]).collect()
}

/// One line: kind, status, resistance at three speeds with the half width of its 95 % interval.
fn describe(reading: &Reading) -> String {
    let snapshot = reading.snapshot;
    let kind = PipelineKind::from_number(snapshot.pipeline_kind).map_or("?", PipelineKind::name);
    let status = reading.status().name();
    format!("{kind:<20} {status:<12} {}", describe_estimate(snapshot))
}

fn describe_estimate(snapshot: &ParameterSnapshot) -> String {
    if snapshot.speed_max_mps <= snapshot.speed_min_mps {
        return "no motion yet".into();
    }
    let middle = 0.5 * (snapshot.speed_min_mps + snapshot.speed_max_mps);
    let speeds = [snapshot.speed_min_mps.ceil(), middle.round(), snapshot.speed_max_mps.floor()];
    let points: Vec<String> = speeds
        .iter()
        .filter_map(|&speed_mps| {
            let estimate = snapshot.resistance_at(speed_mps)?;
            let half_width = HALF_95 * estimate.w0_std_n_per_kn;
            Some(format!("w0({speed_mps:.0} m/s) {:.2} ± {half_width:.2}", estimate.w0_n_per_kn))
        })
        .collect();
    if !points.is_empty() {
        return points.join("   ");
    }
    let count = (snapshot.parameter_count as usize).min(snapshot.values.len());
    (0..count)
        .filter_map(|index| {
            let parameter = dynocar_shared::Parameter::from_number(snapshot.parameters[index])?;
            let half_width = HALF_95 * snapshot.std(parameter)?;
            Some(format!("{} {:.3} ± {half_width:.3}", parameter.name(), snapshot.values[index]))
        })
        .collect::<Vec<_>>()
        .join("   ")
}
