//! Playing recorded runs into the sample channel, as a controller would.

use std::time::Duration;

use dynocar_client::{ChannelError, Host, SamplePublisher, SnapshotReader, monotonic_now_ns};
use dynocar_shared::services::SAMPLE_BUFFER;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};

/// How fast recorded time passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// So many times as fast as it was recorded.
    Times(f64),
    /// As fast as every pipeline follows without a loss.
    Max,
}

impl std::str::FromStr for Rate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "max" {
            return Ok(Rate::Max);
        }
        match text.parse::<f64>() {
            Ok(times) if times.is_finite() && times > 0.0 => Ok(Rate::Times(times)),
            _ => Err(format!("{text:?}: expected a positive number or max")),
        }
    }
}

/// What became of a replay.
#[derive(Clone, Debug, Default)]
pub struct ReplayReport {
    /// Samples handed to the channel.
    pub published: u64,
    /// Samples that the transport did not take.
    pub refused: u64,
    /// Time in s that it took.
    pub elapsed_s: f64,
    /// The newest snapshot of each pipeline at the end.
    pub snapshots: Vec<ParameterSnapshot>,
}

/// The most that a replay at full speed runs ahead of the slowest pipeline.
const AHEAD_MAX: u64 = SAMPLE_BUFFER as u64 / 2;
/// How long pipelines that do not answer are waited for: on a busy machine a thread may get no
/// processor for much longer than a controller would wait.
const PATIENCE: Duration = Duration::from_secs(3);

/// Plays runs one after the other; `progress` hears of each sample's place in its run.
pub struct Replayer {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    rate: Rate,
    report: ReplayReport,
}

impl Replayer {
    /// A replayer for a train's channel.
    ///
    /// # Errors
    ///
    /// When the channel cannot be opened or another controller drives the train.
    pub fn open(host: &Host, train: TrainId, rate: Rate) -> Result<Self, ChannelError> {
        let mut reader = SnapshotReader::open(host, train)?;
        reader.set_stale_after_ns(PATIENCE.as_nanos() as i64);
        Ok(Replayer {
            publisher: SamplePublisher::open(host, train)?,
            reader,
            rate,
            report: ReplayReport::default(),
        })
    }

    /// Waits until a daemon answers, for at most `patience`; true when one does.
    pub fn await_daemon(&mut self, patience: Duration) -> bool {
        let deadline_ns = deadline_ns(patience);
        loop {
            self.reader.poll();
            let now_ns = monotonic_now_ns();
            if self.reader.readings(now_ns).any(|reading| !reading.is_stale) {
                return true;
            }
            if now_ns > deadline_ns {
                return false;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Plays one run; `progress` hears how many of its samples are out.
    pub fn play(&mut self, samples: &[TrainSample], mut progress: impl FnMut(usize)) {
        self.publisher.start_run();
        let start_ns = monotonic_now_ns();
        let first_ns = samples.first().map_or(0, |sample| sample.time_ns);
        for (index, sample) in samples.iter().enumerate() {
            match self.rate {
                Rate::Times(times) => {
                    let recorded_ns = sample.time_ns.saturating_sub(first_ns) as f64;
                    wait_until(start_ns + (recorded_ns / times) as i64);
                }
                Rate::Max => self.follow(),
            }
            let mut sample = *sample;
            if self.publisher.publish(&mut sample).is_err() {
                self.report.refused += 1;
            }
            progress(index + 1);
        }
        self.report.elapsed_s += (monotonic_now_ns() - start_ns) as f64 * 1e-9;
    }

    /// Waits until every pipeline has taken the last sample, and reports.
    pub fn finish(mut self) -> ReplayReport {
        self.await_pipelines(0);
        let now_ns = monotonic_now_ns();
        self.report.snapshots =
            self.reader.readings(now_ns).map(|reading| *reading.snapshot).collect();
        self.report.published = self.publisher.published() - self.report.refused;
        self.report
    }

    /// Lets the pipelines catch up before the sample channel overflows.
    fn follow(&mut self) {
        if self.publisher.published().is_multiple_of(AHEAD_MAX / 4) {
            self.await_pipelines(AHEAD_MAX);
        }
    }

    /// Waits until every living pipeline is at most `behind` samples behind. A pipeline that
    /// stands still for [`PATIENCE`] is not waited for any longer.
    fn await_pipelines(&mut self, behind: u64) {
        let deadline_ns = deadline_ns(PATIENCE);
        loop {
            self.reader.poll();
            let published = self.publisher.published();
            let now_ns = monotonic_now_ns();
            let slowest = self
                .reader
                .readings(now_ns)
                .filter(|reading| !reading.is_stale)
                .map(|reading| published.saturating_sub(reading.snapshot.sample_sequence))
                .max();
            if slowest.is_none_or(|distance| distance <= behind) || now_ns > deadline_ns {
                return;
            }
            std::thread::sleep(Duration::from_micros(50));
        }
    }
}

fn deadline_ns(patience: Duration) -> i64 {
    monotonic_now_ns() + patience.as_nanos() as i64
}

fn wait_until(due_ns: i64) {
    let left_ns = due_ns - monotonic_now_ns();
    if left_ns > 0 {
        std::thread::sleep(Duration::from_nanos(left_ns as u64));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_a_positive_number_or_max() {
        assert_eq!("max".parse(), Ok(Rate::Max));
        assert_eq!("50".parse(), Ok(Rate::Times(50.0)));
        for wrong in ["0", "-1", "fast", "inf", "NaN", ""] {
            let message = wrong.parse::<Rate>().unwrap_err();
            assert!(message.contains("expected a positive number or max"), "{message}");
        }
    }
}
