//! A train's controller in the open loop: sends the samples that are due, and counts the answers.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dynocar_shared::TrainSample;
use dynocar_tests::process::Process;
use dynocar_transport::monotonic_now_ns;
use hdrhistogram::Histogram;

use super::traffic::LoopTraffic;
use super::wire::BenchTransport;
use crate::output::BenchError;
use crate::rig::site::require;
use crate::statistics::{histogram, record};

/// Number of samples in flight that are distinguished; at 10 kHz those of more than a second.
const IN_FLIGHT: usize = 1 << 14;
/// How long a peer may take to answer its first sample.
const READY_WITHIN: Duration = Duration::from_secs(20);
/// Time in ns between the samples that are sent until a peer answers.
const READY_EVERY_NS: i64 = 5_000_000;
/// How long in s after the last sample slow pipelines may go on without anything new.
const SETTLED_AFTER: Duration = Duration::from_secs(1);

/// Counts of the samples of one pipeline, over all trains.
#[derive(Clone, Debug)]
pub struct TrialOutcome {
    /// Samples sent.
    pub offered: u64,
    /// Samples that entered the estimate.
    pub used: u64,
    /// Samples refused.
    pub rejected: u64,
    /// From the appointed time of a sample to the poll that brought a snapshot behind which it
    /// stands. A controller or daemon that was held up pays for every sample it kept waiting.
    pub from_appointed: Histogram<u64>,
    /// From the moment before publishing, as a closed loop would measure.
    pub from_publish: Histogram<u64>,
}

impl TrialOutcome {
    /// Of nothing yet.
    pub fn empty() -> Self {
        let (from_appointed, from_publish) = (histogram(), histogram());
        TrialOutcome { offered: 0, used: 0, rejected: 0, from_appointed, from_publish }
    }

    /// Returns the samples of which the pipeline gave no account: lost, and too late to be noticed as lost.
    pub fn missing(&self) -> u64 {
        self.offered.saturating_sub(self.used + self.rejected)
    }
}

/// How far a pipeline has come: its newest sample, those that it used and those that it refused.
#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    newest: u64,
    used: u64,
    rejected: u64,
}

/// A controller that numbers its samples.
pub struct Controller {
    wire: Box<dyn BenchTransport>,
    traffic: LoopTraffic,
    /// Appointed and actual time in ns of the samples in flight, by number.
    in_flight: Box<[(i64, i64)]>,
    sent: u64,
    /// By pipeline: now, and when counting began.
    answers: Vec<[Answer; 2]>,
    sent_before: u64,
}

impl Controller {
    /// Returns a controller that has sent nothing, and receives from `pipelines` pipelines.
    pub fn new(wire: Box<dyn BenchTransport>, traffic: LoopTraffic, pipelines: usize) -> Self {
        let in_flight = vec![(0, 0); IN_FLIGHT].into();
        let answers = vec![[Answer::default(); 2]; pipelines];
        Controller { wire, traffic, in_flight, sent: 0, answers, sent_before: 0 }
    }

    /// Sends until every pipeline answers: a peer may still be starting.
    ///
    /// # Errors
    ///
    /// When one stays silent, or the peer has ended.
    pub fn await_ready(&mut self, peer: &mut Process) -> Result<(), BenchError> {
        let mut uncounted: Vec<TrialOutcome> =
            self.answers.iter().map(|_| TrialOutcome::empty()).collect();
        let (start, mut next_ns) = (Instant::now(), 0);
        while self.answers.iter().any(|[now, _]| now.newest == 0) {
            if start.elapsed() > READY_WITHIN {
                return Err(format!("no peer answers within {READY_WITHIN:?}").into());
            }
            let now_ns = monotonic_now_ns();
            if now_ns >= next_ns {
                require(peer)?;
                let sample = self.traffic.sample(now_ns);
                self.publish(sample, now_ns)?;
                next_ns = now_ns + READY_EVERY_NS;
            }
            self.poll(&mut uncounted)?;
            std::thread::yield_now();
        }
        Ok(())
    }

    /// Sends `count` samples from a time in ns on; results of earlier ones do not count.
    pub fn begin(&mut self, start_ns: i64, count: u64) {
        self.traffic.begin(start_ns, count);
        self.sent_before = self.sent;
        for [now, before] in &mut self.answers {
            now.newest = self.sent;
            *before = *now;
        }
    }

    /// Adds the fate of the samples since counting began.
    pub fn account(&self, outcomes: &mut [TrialOutcome]) {
        for ([now, before], outcome) in self.answers.iter().zip(outcomes) {
            outcome.offered += self.sent - self.sent_before;
            outcome.used += now.used - before.used;
            outcome.rejected += now.rejected - before.rejected;
        }
    }

    /// Gives how late in ns a sample left.
    fn publish(&mut self, mut sample: TrainSample, appointed_ns: i64) -> Result<i64, BenchError> {
        let left_ns = monotonic_now_ns();
        (sample.sequence, sample.published_ns) = (self.sent + 1, left_ns);
        self.wire.send(&mut sample)?;
        self.sent += 1;
        self.in_flight[self.sent as usize % IN_FLIGHT] = (appointed_ns, left_ns);
        Ok(left_ns - appointed_ns)
    }

    /// Publishes the samples that are due; returns the greatest lateness in ns.
    fn publish_due(&mut self, now_ns: i64) -> Result<i64, BenchError> {
        let mut lag_ns = 0;
        while let Some(&(sample, appointed_ns)) =
            self.traffic.upcoming().filter(|it| it.1 <= now_ns)
        {
            lag_ns = lag_ns.max(self.publish(sample, appointed_ns)?);
            self.traffic.prepare_next();
        }
        Ok(lag_ns)
    }

    fn is_answered(&self) -> bool {
        self.answers.iter().all(|[now, _]| now.newest >= self.sent)
    }

    /// Takes the snapshots that have come, unless none can come; returns whether one was new. An answer to a sample
    /// answers the earlier samples too, for a snapshot rests on all of them.
    fn poll(&mut self, outcomes: &mut [TrialOutcome]) -> Result<bool, BenchError> {
        if !self.wire.carries_others() && self.is_answered() {
            std::hint::spin_loop();
            return Ok(false);
        }
        let Controller { wire, in_flight, answers, sent, .. } = self;
        let mut has_news = false;
        wire.receive(&mut |snapshot| {
            let index = if answers.len() == 1 { 0 } else { snapshot.pipeline_index as usize };
            let pair = answers.get_mut(index).zip(outcomes.get_mut(index));
            let newest = snapshot.sample_sequence.min(*sent);
            let Some(([answer, _], outcome)) = pair.filter(|(it, _)| newest > it[0].newest) else {
                return;
            };
            let now_ns = monotonic_now_ns();
            for sequence in
                newest.saturating_sub(IN_FLIGHT as u64 - 1).max(answer.newest + 1)..=newest
            {
                let (appointed_ns, left_ns) = in_flight[sequence as usize % IN_FLIGHT];
                record(&mut outcome.from_appointed, now_ns - appointed_ns);
                record(&mut outcome.from_publish, now_ns - left_ns);
            }
            let (used, rejected) = (snapshot.samples_used, snapshot.samples_rejected);
            *answer = Answer { newest, used, rejected };
            has_news = true;
        })?;
        Ok(has_news)
    }
}

/// Publishes the samples that are due and polls the trains in turn until a time in ns, or until `is_over` is set;
/// returns the greatest lateness of a sample in ns.
///
/// # Errors
///
/// When a transport fails.
pub fn drive(
    trains: &mut [Controller],
    outcomes: &mut [TrialOutcome],
    until_ns: i64,
    is_over: &AtomicBool,
) -> Result<i64, BenchError> {
    let (mut lag_ns, mut turn) = (0, 0);
    loop {
        let now_ns = monotonic_now_ns();
        for train in trains.iter_mut() {
            lag_ns = lag_ns.max(train.publish_due(now_ns)?);
        }
        if now_ns >= until_ns || is_over.load(Ordering::Relaxed) {
            return Ok(lag_ns);
        }
        turn = (turn + 1) % trains.len();
        trains[turn].poll(outcomes)?;
    }
}

/// Polls until every pipeline has come to its train's last sample, or nothing new comes.
///
/// # Errors
///
/// When a transport fails.
pub fn settle(trains: &mut [Controller], outcomes: &mut [TrialOutcome]) -> Result<(), BenchError> {
    let mut last_news = Instant::now();
    while !trains.iter().all(Controller::is_answered) && last_news.elapsed() < SETTLED_AFTER {
        for train in trains.iter_mut() {
            if train.poll(outcomes)? {
                last_news = Instant::now();
            }
        }
    }
    Ok(())
}
