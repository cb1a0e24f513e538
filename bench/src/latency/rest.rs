//! What a daemon with every fast pipeline takes while no sample comes.

use std::time::{Duration, Instant};

use dynocar::config::IdleStrategy;
use serde::Serialize;

use crate::output::Failure;
use crate::rig::cores::Cores;
use crate::rig::pipelines;
use crate::rig::site::{DaemonPlan, ThreadPlan, require, site, stop};
use crate::rig::usage;

/// How long the daemon may take to start and fall asleep.
const SETTLE: Duration = Duration::from_millis(500);

/// Processor time without samples.
#[derive(Clone, Debug, Serialize)]
pub struct AtRest {
    /// The idle strategy.
    pub idle: String,
    /// Processor time over wall time, in %; 100 is one core.
    pub cpu_percent: f64,
    /// Resident memory in bytes.
    pub rss_bytes: u64,
}

/// Lets a daemon rest for so many seconds.
///
/// # Errors
///
/// When it ends before its time.
pub fn measure(idle: IdleStrategy, cores: Cores, seconds: f64) -> Result<AtRest, Failure> {
    let site = site();
    let thread = ThreadPlan {
        name: "fast",
        core: Some(cores.server),
        idle,
        priority: cores.priority,
        pipelines: pipelines::fast(),
    };
    let plan = DaemonPlan { trains: 1, threads: vec![thread], ..DaemonPlan::default() };
    let mut daemon = plan.start(&site)?;
    std::thread::sleep(SETTLE);
    let usage = || usage::of_process(daemon.id()).unwrap_or_default();
    let (before, start) = (usage(), Instant::now());
    std::thread::sleep(Duration::from_secs_f64(seconds));
    let (after, elapsed_s) = (usage(), start.elapsed().as_secs_f64());
    require(&mut daemon)?;
    stop(daemon)?;
    Ok(AtRest {
        idle: idle.to_string(),
        cpu_percent: 100.0 * (after.cpu_s - before.cpu_s) / elapsed_s,
        rss_bytes: after.rss_bytes,
    })
}
