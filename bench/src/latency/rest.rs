//! What a daemon with every fast pipeline takes while no sample comes.

use std::time::{Duration, Instant};

use dynocar::config::IdleStrategy;
use serde::Serialize;

use crate::rig::RigError;
use crate::rig::child::Peer;
use crate::rig::cores::Cores;
use crate::rig::pipelines;
use crate::rig::site::{DaemonPlan, Site, ThreadPlan};
use crate::rig::usage::{self, ProcessUsage};

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
pub fn measure(idle: IdleStrategy, cores: Cores, seconds: f64) -> Result<AtRest, RigError> {
    let site = Site::new()?;
    let thread = ThreadPlan {
        name: "fast",
        core: Some(cores.server),
        idle,
        priority: cores.priority,
        pipelines: pipelines::fast(),
    };
    let plan = DaemonPlan { trains: 1, threads: vec![thread], lines: String::new() };
    let config = site.write_config(&plan)?;
    let mut daemon = Peer::start(&site, &["daemon", &config.to_string_lossy()])?;
    std::thread::sleep(SETTLE);
    let usage = |daemon: &Peer| -> ProcessUsage {
        usage::of_process(daemon.process_id()).unwrap_or_default()
    };
    let (before, start) = (usage(&daemon), Instant::now());
    std::thread::sleep(Duration::from_secs_f64(seconds));
    let (after, elapsed_s) = (usage(&daemon), start.elapsed().as_secs_f64());
    daemon.require()?;
    daemon.stop()?;
    Ok(AtRest {
        idle: idle.to_string(),
        cpu_percent: 100.0 * (after.cpu_s - before.cpu_s) / elapsed_s,
        rss_bytes: after.rss_bytes,
    })
}
