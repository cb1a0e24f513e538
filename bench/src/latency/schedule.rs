//! The open-loop measurement: samples leave at their appointed times whatever has come back.

use dynocar_client::monotonic_now_ns;
use hdrhistogram::Histogram;

use super::link::Controller;
use crate::output::Failure;
use crate::rig::motion::Motion;
use crate::rig::quantiles::{histogram, record};

/// How a slice of a case is driven.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    /// Samples a second.
    pub rate_hz: f64,
    /// How long samples are sent before counting begins, in s. A new controller wakes every
    /// thread it knows nothing of for half a second; that is not to be measured.
    pub warm_up_s: f64,
    /// How long is measured, in s.
    pub measure_s: f64,
}

/// Latencies of one slice.
#[derive(Clone, Debug)]
pub struct Slice {
    /// From the appointed time of a sample to the poll that brought a snapshot behind which it
    /// stands. A controller or daemon that was held up pays for every sample it kept waiting.
    pub from_appointed: Histogram<u64>,
    /// From the moment before publishing: what a closed loop would measure.
    pub from_publish: Histogram<u64>,
    /// Where the time from publishing went: until the sample left, until its answer left, until
    /// that was polled. Empty where the peer does not say.
    pub stages: [Histogram<u64>; 3],
    /// Samples to which no snapshot came within [`ANSWER_WITHIN_S`].
    pub unanswered: u64,
}

impl Slice {
    fn empty() -> Self {
        Slice {
            from_appointed: histogram(),
            from_publish: histogram(),
            stages: std::array::from_fn(|_| histogram()),
            unanswered: 0,
        }
    }

    fn record_stages(&mut self, actual_ns: i64, stamps: Option<(i64, i64)>, polled_ns: i64) {
        if let Some((left_ns, answered_ns)) = stamps {
            let stages = [left_ns - actual_ns, answered_ns - left_ns, polled_ns - answered_ns];
            for (histogram, stage_ns) in self.stages.iter_mut().zip(stages) {
                record(histogram, stage_ns);
            }
        }
    }
}

/// How long an answer may take before it counts as none, in s.
pub const ANSWER_WITHIN_S: u64 = 2;
/// Samples in flight that are distinguished; at 10 kHz more than a second.
const IN_FLIGHT: usize = 1 << 14;
/// Time before an appointment in which nothing else is begun, in ns.
const QUIET_NS: i64 = 3_000;
/// How long a peer may take to answer its first sample, in s.
const READY_WITHIN_S: u64 = 20;

/// Appointed and actual time of the samples in flight, by sequence number.
struct InFlight {
    times: Box<[(i64, i64)]>,
    answered: u64,
}

/// Sends until the peer answers: it may still be starting.
///
/// # Errors
///
/// When it stays silent.
pub fn await_ready(
    link: &mut Controller,
    motion: &mut Motion,
    mut require: impl FnMut() -> Result<(), Failure>,
) -> Result<(), Failure> {
    let start_ns = monotonic_now_ns();
    let mut next_ns = start_ns;
    let mut sent = 0;
    while link.poll()? == 0 || sent == 0 {
        let now_ns = monotonic_now_ns();
        if now_ns - start_ns > READY_WITHIN_S as i64 * 1_000_000_000 {
            return Err(format!("no peer answers within {READY_WITHIN_S} s").into());
        }
        if now_ns >= next_ns {
            require()?;
            sent = link.publish(&mut motion.sample(now_ns))?;
            next_ns = now_ns + 5_000_000;
        } else {
            std::thread::yield_now();
        }
    }
    Ok(())
}

/// Drives one slice over a link whose peer answers: so many samples a second for so long.
///
/// # Errors
///
/// When the transport fails.
pub fn drive(
    link: &mut Controller,
    motion: &mut Motion,
    rate_hz: f64,
    seconds: f64,
) -> Result<Slice, Failure> {
    let period_ns = 1e9 / rate_hz;
    let total = (seconds * rate_hz).max(1.0) as u64;
    let mut slice = Slice::empty();
    let mut in_flight = InFlight { times: vec![(0, 0); IN_FLIGHT].into(), answered: 0 };
    let start_ns = monotonic_now_ns() + 1_000_000;
    let mut newest = 0;
    for number in 0..total {
        let appointed_ns = start_ns + (number as f64 * period_ns) as i64;
        let mut sample = motion.sample(appointed_ns);
        while monotonic_now_ns() < appointed_ns - QUIET_NS {
            link.rest()?;
        }
        while monotonic_now_ns() < appointed_ns {
            std::hint::spin_loop();
        }
        let actual_ns = monotonic_now_ns();
        newest = link.publish(&mut sample)?;
        if number == 0 {
            in_flight.answered = newest - 1;
        }
        in_flight.times[newest as usize % IN_FLIGHT] = (appointed_ns, actual_ns);
        let next_ns = start_ns + ((number + 1) as f64 * period_ns) as i64;
        in_flight.await_answer(link, newest, next_ns, &mut slice)?;
    }
    let deadline_ns = monotonic_now_ns() + ANSWER_WITHIN_S as i64 * 1_000_000_000;
    in_flight.await_answer(link, newest, deadline_ns, &mut slice)?;
    slice.unanswered = newest - in_flight.answered;
    Ok(slice)
}

impl InFlight {
    /// Polls until this sample is answered or the time has come; an answer to a sample answers
    /// those before it too, for a snapshot stands on all of them.
    fn await_answer(
        &mut self,
        link: &mut Controller,
        sequence: u64,
        until_ns: i64,
        slice: &mut Slice,
    ) -> Result<(), Failure> {
        while self.answered < sequence {
            let newest = link.poll()?;
            if newest > self.answered {
                let now_ns = monotonic_now_ns();
                let oldest = newest.saturating_sub(IN_FLIGHT as u64 - 1).max(self.answered + 1);
                for sequence in oldest..=newest.min(sequence) {
                    let (appointed_ns, actual_ns) = self.times[sequence as usize % IN_FLIGHT];
                    record(&mut slice.from_appointed, now_ns - appointed_ns);
                    record(&mut slice.from_publish, now_ns - actual_ns);
                }
                if newest == sequence {
                    let (_, actual_ns) = self.times[sequence as usize % IN_FLIGHT];
                    slice.record_stages(actual_ns, link.stamps(), now_ns);
                }
                self.answered = newest.min(sequence);
            } else if monotonic_now_ns() >= until_ns {
                break;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::link::{Answer, Wire};
    use super::*;
    use dynocar_shared::{TrainId, TrainSample};

    fn answer(newest: u64) -> Result<Option<Answer>, Failure> {
        Ok(Some(Answer { newest, ..Answer::default() }))
    }

    /// Answers at once, but is silent while it is held up.
    struct HeldUp {
        sent: u64,
        silent_from: u64,
        until_ns: i64,
    }

    impl Wire for HeldUp {
        fn send(&mut self, sample: &mut TrainSample) -> Result<(), Failure> {
            self.sent = sample.sequence;
            if self.sent == self.silent_from {
                self.until_ns = monotonic_now_ns() + 50_000_000;
            }
            Ok(())
        }

        fn receive(&mut self) -> Result<Option<Answer>, Failure> {
            let is_silent = monotonic_now_ns() < self.until_ns;
            answer(if is_silent { self.silent_from - 1 } else { self.sent })
        }
    }

    #[test]
    fn every_sample_that_a_standstill_kept_waiting_is_counted_with_its_wait() {
        let mut link = Controller::new(HeldUp { sent: 0, silent_from: 100, until_ns: 0 });
        let slice = drive(&mut link, &mut Motion::of(TrainId(1), 0), 1_000.0, 0.2).unwrap();
        assert_eq!((slice.from_appointed.len(), slice.unanswered), (200, 0));
        // A standstill of 50 ms keeps 50 samples of a kHz waiting, 25 ms in the mean.
        let waited = slice.from_appointed.len() - slice.from_appointed.count_between(0, 1_000_000);
        assert!(waited >= 45, "{waited}");
        assert!(slice.from_appointed.max() >= 49_000_000);
    }

    #[test]
    fn a_sample_without_an_answer_is_counted_as_such() {
        struct Silent(u64);
        impl Wire for Silent {
            fn send(&mut self, _: &mut TrainSample) -> Result<(), Failure> {
                self.0 += 1;
                Ok(())
            }

            fn receive(&mut self) -> Result<Option<Answer>, Failure> {
                answer(self.0.min(3))
            }
        }
        let mut motion = Motion::of(TrainId(1), 0);
        let slice = drive(&mut Controller::new(Silent(0)), &mut motion, 10_000.0, 5e-4).unwrap();
        assert_eq!((slice.from_appointed.len(), slice.unanswered), (3, 2));
    }
}
