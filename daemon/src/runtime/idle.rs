//! Idle strategies of a pipeline thread.

use std::time::Duration;

use dynocar_transport::channel::Sleeper;

use crate::config::IdleStrategy;

/// Decides, between two polls for samples, whether to poll again at once or to sleep.
pub struct Idler {
    spin_ns: i64,
    last_work_ns: i64,
    /// `None` for a thread that never sleeps.
    sleeper: Option<Sleeper>,
    sleep_max: Duration,
}

impl Idler {
    /// Returns an idler; `sleeper` puts the thread to sleep, unless it never sleeps.
    pub fn new(
        strategy: IdleStrategy,
        spin_us: u64,
        heartbeat_ms: u64,
        sleeper: Option<Sleeper>,
    ) -> Self {
        let spin_us = match strategy {
            IdleStrategy::Busy => u64::MAX,
            IdleStrategy::Adaptive => spin_us,
            IdleStrategy::Event => 0,
        };
        Idler {
            spin_ns: i64::try_from(spin_us.saturating_mul(1_000)).unwrap_or(i64::MAX),
            last_work_ns: 0,
            sleeper: sleeper.filter(|_| strategy != IdleStrategy::Busy),
            sleep_max: Duration::from_millis(heartbeat_ms),
        }
    }

    /// Remembers that there was work at this time.
    pub fn had_work(&mut self, now_ns: i64) {
        self.last_work_ns = now_ns;
    }

    /// Returns at once or after a sleep; `has_work` is asked once more before falling asleep.
    pub fn pause(&mut self, now_ns: i64, has_work: impl FnOnce() -> bool) {
        match &mut self.sleeper {
            Some(sleeper) if now_ns.saturating_sub(self.last_work_ns) >= self.spin_ns => {
                sleeper.sleep(self.sleep_max, has_work);
            }
            _ => {}
        }
    }

    /// Speaks up to controllers that have come since.
    pub fn serve_newcomers(&self) {
        if let Some(sleeper) = &self.sleeper {
            sleeper.serve_newcomers();
        }
    }
}
