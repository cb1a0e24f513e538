//! The live view: one line a pipeline, a bar for the runs; plain lines without a terminal.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use dynocar_client::{Reading, SnapshotReader};
use dynocar_shared::{ParameterSnapshot, PipelineKind};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use dynocar_dataset::Dataset;

use crate::output::tell;

/// How often a plain line is written for each pipeline.
const PLAIN_EVERY: Duration = Duration::from_secs(3);

/// Shows the estimates as they come.
pub struct View {
    total: u64,
    bars: Option<Bars>,
    last_plain: Option<Instant>,
}

struct Bars {
    all: MultiProgress,
    samples: ProgressBar,
    pipelines: Vec<ProgressBar>,
}

impl View {
    /// A view of the replay of a dataset with so many samples.
    pub fn new(dataset: &Dataset, total: u64, rate: f64) -> Self {
        tell(&format!(
            "{}: {} recorded runs at {rate} times their speed",
            dataset.train.name,
            dataset.runs.len()
        ));
        tell("controller, daemon and client are three processes; ± is a 95 % interval");
        let bars = std::io::stderr().is_terminal().then(|| Bars::new(total));
        View { total, bars, last_plain: None }
    }

    /// Shows what the reader knows.
    pub fn draw(&mut self, reader: &SnapshotReader, now_ns: i64) {
        match &mut self.bars {
            Some(bars) => bars.draw(reader, now_ns),
            None => {
                if self.last_plain.is_none_or(|last| last.elapsed() >= PLAIN_EVERY) {
                    self.last_plain = Some(Instant::now());
                    self.write_lines(reader, now_ns);
                }
            }
        }
    }

    /// Leaves the last state on the screen.
    pub fn finish(&mut self) {
        if let Some(bars) = &self.bars {
            bars.samples.abandon();
            bars.pipelines.iter().for_each(ProgressBar::abandon);
        }
    }

    fn write_lines(&self, reader: &SnapshotReader, now_ns: i64) {
        for reading in reader.readings(now_ns) {
            let percent = 100 * reading.snapshot.sample_sequence / self.total.max(1);
            tell(&format!("{percent:3} %  {}", describe(&reading)));
        }
    }
}

impl Bars {
    fn new(total: u64) -> Self {
        let all = MultiProgress::new();
        let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} samples, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let samples = all.add(ProgressBar::new(total).with_style(style));
        Bars { all, samples, pipelines: Vec::new() }
    }

    fn draw(&mut self, reader: &SnapshotReader, now_ns: i64) {
        for (place, reading) in reader.readings(now_ns).enumerate() {
            if place == self.pipelines.len() {
                let style = ProgressStyle::with_template("{msg}")
                    .unwrap_or_else(|_| ProgressStyle::default_spinner());
                let line = ProgressBar::new_spinner().with_style(style);
                self.pipelines.push(self.all.insert_before(&self.samples, line));
            }
            self.pipelines[place].set_message(describe(&reading));
            self.samples.set_position(reading.snapshot.sample_sequence);
        }
    }
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
            let half_width = 1.96 * estimate.w0_std_n_per_kn;
            Some(format!("w0({speed_mps:.0} m/s) {:.2} ± {half_width:.2}", estimate.w0_n_per_kn))
        })
        .collect();
    if !points.is_empty() {
        return points.join("   ");
    }
    let count = (snapshot.parameter_count as usize).min(snapshot.values.len());
    (0..count)
        .filter_map(|place| {
            let parameter = dynocar_shared::Parameter::from_number(snapshot.parameters[place])?;
            let half_width = 1.96 * snapshot.std(parameter)?;
            Some(format!("{} {:.3} ± {half_width:.3}", parameter.name(), snapshot.values[place]))
        })
        .collect::<Vec<_>>()
        .join("   ")
}
