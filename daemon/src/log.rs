//! The daemon's log: lines in a bounded queue, which a thread of its own writes to standard error.
//!
//! A reader of the log may stand still, and a full pipe blocks every writer. Therefore only that thread writes: a line
//! that finds the queue full is dropped, and the log reports how many were.
//!
//! # Changes that the log reports
//!
//! A status that was not reported lately is reported at once. A status that comes back is reported only after it has
//! stayed for a while, which grows with each return: an estimate at the edge of a threshold flips between two statuses
//! for as long as it is there.
//!
//! The first refused samples are reported at once, later ones together and not too often. Refusals that are normal, for
//! wheel slide and the estimators' own outliers, are only counted.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use dynocar_core::remedy::of_refusal;
use dynocar_shared::RejectionReason;
use dynocar_shared::snapshot::REJECTION_REASONS;
use tracing_subscriber::fmt::MakeWriter;

use crate::operator::refusals;
use crate::output::report_line;

/// Lines that fit into every queue: the log of some minutes.
const LINES_MIN: usize = 1024;
/// Stack of the thread that writes: it may be locked into memory.
const STACK_BYTES: usize = 64 * 1024;
/// How long an ending program waits for its last lines to be taken.
const PATIENCE: Duration = Duration::from_millis(500);

/// Where lines are queued.
#[derive(Clone, Debug)]
pub struct Queue {
    lines: SyncSender<Vec<u8>>,
    counts: Arc<Counts>,
}

#[derive(Debug, Default)]
struct Counts {
    waiting: AtomicU64,
    dropped: AtomicU64,
}

impl Queue {
    /// Starts the thread that writes; `burst` is the most lines that are said at once.
    ///
    /// # Errors
    ///
    /// When the system gives no thread.
    pub fn start(burst: usize) -> io::Result<Self> {
        let (lines, queued) = sync_channel(LINES_MIN + burst);
        let counts = Arc::new(Counts::default());
        let of_thread = Arc::clone(&counts);
        let builder = std::thread::Builder::new().name("log".into()).stack_size(STACK_BYTES);
        builder.spawn(move || write_all(&queued, &of_thread))?;
        Ok(Queue { lines, counts })
    }
}

/// The log of a program; when it is dropped, the last lines are waited for, a short time at most.
#[derive(Debug)]
pub struct Log(pub Queue);

impl Drop for Log {
    fn drop(&mut self) {
        let start = Instant::now();
        while self.0.counts.waiting.load(Ordering::Acquire) > 0 && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn write_all(queued: &Receiver<Vec<u8>>, counts: &Counts) {
    for line in queued {
        // A log that cannot be written is reported nowhere, and ends no daemon.
        let _ = io::stderr().lock().write_all(&line);
        let dropped = counts.dropped.swap(0, Ordering::Relaxed);
        if dropped > 0 {
            report_line(&format!(
                "dynocar: {dropped} lines of the log were dropped: nobody took them from standard error"
            ));
        }
        counts.waiting.fetch_sub(1, Ordering::Release);
    }
}

impl Write for Queue {
    /// Takes a line as a whole; never waits.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.counts.waiting.fetch_add(1, Ordering::Relaxed);
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) =
            self.lines.try_send(line.to_vec())
        {
            self.counts.waiting.fetch_sub(1, Ordering::Release);
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for Queue {
    type Writer = Queue;

    fn make_writer(&'a self) -> Queue {
        self.clone()
    }
}

/// Status and reason by number.
pub type StatusAndReason = (u32, u32);

/// Time for which a status that comes back has to stay until it is reported, at first.
const STAY_MIN: Duration = Duration::from_secs(2);
/// Longest such time; a status that was not reported for as long counts as new.
const STAY_MAX: Duration = Duration::from_secs(120);
/// Number of statuses that are remembered.
const REMEMBERED: usize = 8;

/// The statuses of one pipeline that the log has reported.
#[derive(Clone, Debug)]
pub struct StatusLog {
    /// Reported states, with the time at which each last held; the newest last.
    reported: Vec<(StatusAndReason, Instant)>,
    seen: StatusAndReason,
    since: Instant,
    stay: Duration,
    /// Statuses that came since the last one that was reported, with how often each did.
    untold: Vec<(StatusAndReason, u64)>,
    changes: u64,
}

impl StatusLog {
    /// Returns a log in which nothing has been reported.
    pub fn new(now: Instant) -> Self {
        StatusLog {
            reported: Vec::new(),
            seen: (0, 0),
            since: now,
            stay: STAY_MIN,
            untold: Vec::new(),
            changes: 0,
        }
    }

    /// Looks at the status; when it is to be reported, the statuses that came since the last that was
    /// and were not, with how often each did.
    pub fn look(
        &mut self,
        state: StatusAndReason,
        now: Instant,
    ) -> Option<Vec<(StatusAndReason, u64)>> {
        if state != self.seen {
            (self.seen, self.since) = (state, now);
            match self.untold.iter_mut().find(|it| it.0 == state) {
                Some(it) => it.1 += 1,
                None => self.untold.push((state, 1)),
            }
            self.changes += 1;
        }
        self.reported.retain(|it| now.duration_since(it.1) < STAY_MAX);
        let Some(index) = self.reported.iter().position(|it| it.0 == state) else {
            self.stay = STAY_MIN;
            return self.report(now);
        };
        self.reported[index].1 = now;
        if index + 1 == self.reported.len() || now.duration_since(self.since) < self.stay {
            return None;
        }
        self.reported.remove(index);
        self.stay = (2 * self.stay).min(STAY_MAX);
        self.report(now)
    }

    /// Changes seen so far, reported or not.
    pub fn changes(&self) -> u64 {
        self.changes
    }

    fn report(&mut self, now: Instant) -> Option<Vec<(StatusAndReason, u64)>> {
        if self.reported.len() == REMEMBERED {
            self.reported.remove(0);
        }
        self.reported.push((self.seen, now));
        let mut untold = std::mem::take(&mut self.untold);
        // The last of them is the one that is reported.
        untold.iter_mut().filter(|it| it.0 == self.seen).for_each(|it| it.1 -= 1);
        untold.retain(|it| it.1 > 0);
        Some(untold)
    }
}

/// Time over which later refusals are gathered.
const GATHER: Duration = Duration::from_secs(60);

/// The refused samples of one train as the log knows them.
#[derive(Clone, Debug, Default)]
pub struct RefusalLog {
    /// Counts when the log last named them.
    named: [u32; REJECTION_REASONS],
    last: Option<Instant>,
}

impl RefusalLog {
    /// Looks at the counts; gives those to be named now, the most frequent first.
    pub fn look(
        &mut self,
        counts: &[u32; REJECTION_REASONS],
        now: Instant,
    ) -> Vec<(RejectionReason, u32)> {
        if self.last.is_some_and(|last| now.duration_since(last) < GATHER) {
            return Vec::new();
        }
        let new = std::array::from_fn(|index| counts[index].saturating_sub(self.named[index]));
        let mut all = refusals(&new);
        all.retain(|(reason, _)| of_refusal(*reason).is_some());
        if !all.is_empty() {
            (self.named, self.last) = (*counts, Some(now));
        }
        all
    }
}

#[cfg(test)]
mod status_log_tests {
    use super::*;

    const GOOD: StatusAndReason = (2, 0);
    const AT_BOUND: StatusAndReason = (2, 7);
    const INVALID: StatusAndReason = (4, 3);

    /// Returns the reports of a status given by tenth of a second: (time in s, status, unreported changes).
    fn reported(
        state_at: impl Fn(u64) -> StatusAndReason,
        seconds: u64,
    ) -> Vec<(f64, StatusAndReason, u64)> {
        let start = Instant::now();
        let mut log = StatusLog::new(start);
        (0..10 * seconds)
            .filter_map(|tenth| {
                let now = start + Duration::from_millis(100 * tenth);
                let untold = log.look(state_at(tenth), now)?.iter().map(|it| it.1).sum();
                Some((tenth as f64 / 10.0, state_at(tenth), untold))
            })
            .collect()
    }

    #[test]
    fn a_status_that_is_new_is_reported_at_once_and_once() {
        let state = |tenth| if tenth < 45 { GOOD } else { INVALID };
        assert_eq!(reported(state, 60), [(0.0, GOOD, 0), (4.5, INVALID, 0)]);
    }

    #[test]
    fn a_status_that_flips_is_reported_once_and_its_flips_are_counted_when_it_stays() {
        // Flips each 0.3 s for a minute, then stays.
        let state = |tenth| {
            if tenth < 600 && (tenth / 3) % 2 == 0 { GOOD } else { AT_BOUND }
        };
        let first = [(0.0, GOOD, 0), (0.3, AT_BOUND, 0)];
        assert_eq!(reported(state, 100), first, "what was reported last holds again");
        let ends_good = |tenth| if tenth < 600 { state(tenth) } else { GOOD };
        assert_eq!(reported(ends_good, 100), [first[0], first[1], (62.0, GOOD, 198)]);
    }

    #[test]
    fn what_was_not_reported_is_named_with_how_often_it_came() {
        let start = Instant::now();
        let mut log = StatusLog::new(start);
        let mut at =
            |tenth: u64, state| log.look(state, start + Duration::from_millis(100 * tenth));
        assert_eq!(at(0, GOOD), Some(vec![]));
        assert_eq!(at(1, AT_BOUND), Some(vec![]));
        assert_eq!((at(2, GOOD), at(3, AT_BOUND), at(4, GOOD)), (None, None, None));
        assert_eq!(at(5, INVALID), Some(vec![(GOOD, 2), (AT_BOUND, 1)]));
    }

    #[test]
    fn a_return_that_stays_is_called_soon() {
        let state = |tenth| if (100..105).contains(&tenth) { INVALID } else { GOOD };
        assert_eq!(reported(state, 60), [(0.0, GOOD, 0), (10.0, INVALID, 0), (12.5, GOOD, 0)]);
    }

    #[test]
    fn slow_flips_are_reported_ever_more_seldom() {
        let state = |tenth| if (tenth / 50) % 2 == 0 { GOOD } else { AT_BOUND };
        let reported = reported(state, 3_600);
        assert!((3..=8).contains(&reported.len()), "720 flips in an hour: {reported:?}");
    }

    #[test]
    fn a_status_comes_as_news_when_it_was_not_reported_for_long() {
        let state = |tenth| if (100..3_000).contains(&tenth) { INVALID } else { GOOD };
        assert_eq!(reported(state, 400), [(0.0, GOOD, 0), (10.0, INVALID, 0), (300.0, GOOD, 0)]);
    }
}

#[cfg(test)]
mod refusal_log_tests {
    use super::*;

    #[test]
    fn the_first_refusal_is_named_at_once_and_the_next_together() {
        let start = Instant::now();
        let mut log = RefusalLog::default();
        let mut counts = [0; REJECTION_REASONS];
        assert!(log.look(&counts, start).is_empty());
        counts[RejectionReason::WheelSlide as usize] = 9;
        assert!(log.look(&counts, start).is_empty(), "as it should be");
        let mut named = Vec::new();
        for second in 0..130 {
            counts[RejectionReason::SpeedJump as usize] += 1;
            counts[RejectionReason::Repeated as usize] += u32::from(second == 70);
            let now = start + Duration::from_secs(second);
            named.extend(log.look(&counts, now).into_iter().map(|it| (second, it.0, it.1)));
        }
        assert_eq!(
            named,
            [
                (0, RejectionReason::SpeedJump, 1),
                (60, RejectionReason::SpeedJump, 60),
                (120, RejectionReason::SpeedJump, 60),
                (120, RejectionReason::Repeated, 1),
            ]
        );
    }
}
