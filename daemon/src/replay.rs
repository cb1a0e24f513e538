//! Playing recorded runs into the sample channel, as a controller would.

use std::time::Duration;

use dynocar_client::{SamplePublisher, SnapshotReader};
use dynocar_shared::services::SAMPLE_BUFFER;
use dynocar_shared::{ParameterSnapshot, RejectionReason, TrainId, TrainSample};
use dynocar_transport::{ChannelError, Host, Peer, monotonic_now_ns};

use crate::operator::refusals;

/// How fast recorded time passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// This many times as fast as it was recorded.
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

/// Summary of a replay.
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
    /// The newest snapshot of each pipeline before the first sample.
    before: Vec<ParameterSnapshot>,
}

/// Counts of one pipeline over a replay's samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplayCounts {
    /// Samples that entered the estimate.
    pub used: u64,
    /// Samples refused.
    pub rejected: u64,
    /// Samples that never arrived.
    pub lost: u64,
    /// Samples refused by reason, the most frequent first.
    pub reasons: Vec<(RejectionReason, u32)>,
}

impl ReplayReport {
    /// Returns the counts of a pipeline over this replay's samples alone, from its snapshot at the end.
    pub fn taken(&self, after: &ParameterSnapshot) -> ReplayCounts {
        let is_same = |it: &&ParameterSnapshot| {
            (it.epoch, it.pipeline_index) == (after.epoch, after.pipeline_index)
        };
        // A daemon that came meanwhile has counted nothing else.
        let before = self.before.iter().find(is_same).copied();
        let before = before.unwrap_or(ParameterSnapshot::empty());
        let [now, then] = [after, &before].map(|it| &it.rejected_by_reason);
        let new = std::array::from_fn(|index| now[index].saturating_sub(then[index]));
        ReplayCounts {
            used: after.samples_used.saturating_sub(before.samples_used),
            rejected: after.samples_rejected.saturating_sub(before.samples_rejected),
            lost: after.samples_lost.saturating_sub(before.samples_lost),
            reasons: refusals(&new),
        }
    }

    /// Returns whether at least one pipeline used at least half of the samples.
    pub fn was_used(&self) -> bool {
        let used = self.snapshots.iter().map(|it| self.taken(it).used).max();
        2 * used.unwrap_or(0) >= self.published + self.refused
    }
}

/// The most that a replay at full speed runs ahead of the slowest pipeline.
const AHEAD_MAX: u64 = SAMPLE_BUFFER as u64 / 2;
/// How long pipelines that do not answer are waited for: on a busy machine a thread may get no
/// processor for much longer than a controller would wait.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long a daemon that has announced itself is waited for until all its pipelines answer.
const START_PATIENCE: Duration = Duration::from_secs(10);

/// Plays runs one after the other; `progress` hears of each sample's place in its run.
pub struct Replayer {
    publisher: SamplePublisher,
    reader: SnapshotReader,
    rate: Rate,
    report: ReplayReport,
}

impl Replayer {
    /// Returns a replayer for a train's channel.
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

    /// Waits until every pipeline of a daemon answers; true when one does. Where no daemon has
    /// announced itself, for at most `patience`.
    pub fn await_daemon(&mut self, patience: Duration) -> bool {
        let deadline_ns = deadline_ns(patience);
        let late_ns = deadline_ns + START_PATIENCE.as_nanos() as i64;
        loop {
            let is_there = matches!(self.reader.daemon(), Ok(Peer::Compatible(_)));
            if is_there && self.all_answer() {
                // The samples that the controller before has left are not ours.
                self.await_taken(0);
                self.report.before = self.newest();
                return true;
            }
            let now_ns = monotonic_now_ns();
            if now_ns > late_ns || (now_ns > deadline_ns && !is_there) {
                return false;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Returns whether as many pipelines answer as the daemon has.
    fn all_answer(&mut self) -> bool {
        self.reader.poll();
        let now_ns = monotonic_now_ns();
        let answering = self.reader.readings(now_ns).filter(|reading| !reading.is_stale).count();
        answering >= self.publisher.pipelines().max(1)
    }

    fn newest(&mut self) -> Vec<ParameterSnapshot> {
        self.reader.poll();
        self.reader.readings(monotonic_now_ns()).map(|reading| *reading.snapshot).collect()
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
        self.await_taken(0);
        self.report.snapshots = self.newest();
        self.report.published = self.publisher.published() - self.report.refused;
        self.report
    }

    /// Lets the pipelines catch up before the sample channel overflows.
    fn follow(&mut self) {
        if self.publisher.published().is_multiple_of(AHEAD_MAX / 4) {
            self.await_taken(AHEAD_MAX);
        }
    }

    /// Waits until the slowest pipeline is at most `behind` samples behind. When it stands still for
    /// [`PATIENCE`], or nobody is heard of any more, it is not waited for any longer.
    fn await_taken(&mut self, behind: u64) {
        let (mut least, mut deadline) = (u64::MAX, 0);
        while let Some(untaken) = self.publisher.untaken().filter(|&it| it > behind) {
            self.reader.poll();
            let now_ns = monotonic_now_ns();
            if untaken < least {
                (least, deadline) = (untaken, deadline_ns(PATIENCE));
            }
            if now_ns > deadline || self.reader.readings(now_ns).all(|reading| reading.is_stale) {
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
