//! Cores and priorities of a measurement, and what the host takes away from threads that are always busy.

use std::time::{Duration, Instant};

use clap::Args;
use dynocar::output::report_line;
use dynocar::runtime::system::{pin_to_core, set_fifo_priority};
use serde::Serialize;

use crate::parallel;

/// The two cores of a measurement, and the priority of what runs there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cores {
    /// Where the controller publishes and polls.
    pub controller: usize,
    /// Where the answering thread runs.
    pub server: usize,
    /// Real-time priority on both; ordinary when absent.
    pub priority: Option<u8>,
}

/// Where a measurement of processes runs.
#[derive(Clone, Copy, Debug, Args)]
pub struct CoreArguments {
    /// Core of the controller, or of the publishers
    #[arg(long, value_name = "CORE")]
    controller_core: Option<usize>,
    /// Core of the daemon's thread, and of whatever else answers
    #[arg(long, value_name = "CORE")]
    daemon_core: Option<usize>,
    /// Real-time priority (SCHED_FIFO) of the controller and of whatever answers, 1 to 99
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Seed of everything drawn
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl Cores {
    /// The cores asked for, else the first two; on a machine with one core both are the same.
    pub fn choose(asked: &CoreArguments) -> Self {
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let controller = asked.controller_core.unwrap_or(0);
        let other = (controller + 1) % count.max(1);
        let server = asked.daemon_core.unwrap_or(other);
        Cores { controller, server, priority: asked.priority }
    }
}

/// Runs something in a thread of its own, which it may bind to a core: threads and processes
/// that are started before are not bound with it.
pub fn in_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| match scope.spawn(work).join() {
        Ok(result) => result,
        Err(panic) => std::panic::resume_unwind(panic),
    })
}

/// Binds the calling thread to a core; without that the figures vary more, which is said.
pub fn bind(core: usize) {
    said(&format!("not bound to core {core}"), pin_to_core(core));
}

/// Gives the calling thread, and every thread it starts from then on, a real-time priority; without
/// it the figures vary more, which is said.
pub fn prioritise(priority: Option<u8>) {
    if let Some(priority) = priority {
        said(&format!("no priority {priority}"), set_fifo_priority(priority));
    }
}

fn said<E: std::fmt::Display>(lacking: &str, result: Result<(), E>) {
    if let Err(error) = result {
        report_line(&format!("dynocar-bench: {lacking}, figures will vary more: {error}"));
    }
}

/// A look at the clock that comes so long after the last one was kept from it.
const GAP_MIN: Duration = Duration::from_micros(20);

/// The times for which two busy threads, where controller and daemon run, were kept from their
/// cores: by the kernel, by other processes, or by the machine beneath.
#[derive(Clone, Debug, Default)]
pub struct HostGaps {
    gaps_s: Vec<f64>,
    watched_s: f64,
}

/// The same in figures.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct HostFigures {
    /// Share of the time for which one of the two threads was away, in %.
    pub away_percent: f64,
    /// Longest gap in ns.
    pub longest_ns: u64,
    /// p99 of the latency that nothing but these gaps would bring.
    pub p99_ns: u64,
    /// p99.9 of the same.
    pub p999_ns: u64,
}

impl HostGaps {
    /// Watches both cores for some time and adds what is seen.
    pub fn watch(&mut self, cores: Cores, seconds: f64) {
        let watched = Duration::from_secs_f64(seconds);
        let gaps_s = parallel::over(&[cores.controller, cores.server], 2, |&core| {
            bind(core);
            prioritise(cores.priority);
            gaps_s(watched)
        });
        self.gaps_s.extend(gaps_s.into_iter().flatten());
        self.watched_s += seconds;
    }

    /// What was seen, in figures.
    pub fn figures(&self) -> HostFigures {
        let longest_s = self.gaps_s.iter().copied().fold(0.0, f64::max);
        let ns = |seconds: f64| (seconds * 1e9).round() as u64;
        HostFigures {
            away_percent: 100.0 * self.share_later_than(0.0),
            longest_ns: ns(longest_s),
            p99_ns: ns(self.exceeded_by(0.01, longest_s)),
            p999_ns: ns(self.exceeded_by(0.001, longest_s)),
        }
    }

    /// Share of the moments at which a message would wait longer than this for its thread.
    fn share_later_than(&self, wait_s: f64) -> f64 {
        let waiting_s: f64 = self.gaps_s.iter().map(|gap_s| (gap_s - wait_s).max(0.0)).sum();
        waiting_s / self.watched_s.max(f64::MIN_POSITIVE)
    }

    /// The wait in s that this share of the moments exceeds; it falls with the share.
    fn exceeded_by(&self, share: f64, longest_s: f64) -> f64 {
        let (mut low_s, mut high_s) = (0.0, longest_s);
        for _ in 0..60 {
            let middle_s = 0.5 * (low_s + high_s);
            if self.share_later_than(middle_s) > share {
                low_s = middle_s;
            } else {
                high_s = middle_s;
            }
        }
        high_s
    }
}

fn gaps_s(watched: Duration) -> Vec<f64> {
    let mut gaps_s = Vec::with_capacity(1 << 16);
    let start = Instant::now();
    let mut last = start;
    while last - start < watched {
        let now = Instant::now();
        if now - last > GAP_MIN {
            gaps_s.push((now - last).as_secs_f64());
        }
        last = now;
    }
    gaps_s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wait_follows_from_the_gaps() {
        // 1 s in which a thread is away 10 times for 2 ms: 2 % of the moments.
        let host = HostGaps { gaps_s: vec![2e-3; 10], watched_s: 1.0 };
        let figures = host.figures();
        assert!((figures.away_percent - 2.0).abs() < 1e-9);
        assert_eq!(figures.longest_ns, 2_000_000);
        // Half of these moments have more than half of the gap before them.
        assert_eq!(figures.p99_ns, 1_000_000);
        assert_eq!(HostGaps::default().figures().p99_ns, 0);
    }

    #[test]
    fn watching_sees_the_time_it_was_given() {
        let mut host = HostGaps::default();
        host.watch(Cores { controller: 0, server: 0, priority: None }, 0.02);
        assert_eq!(host.watched_s, 0.02);
        assert!(host.figures().longest_ns as f64 * 1e-9 <= host.gaps_s.iter().sum::<f64>() + 1e-9);
    }
}
