//! The highest rate without loss, and how things grow with trains and pipelines.

use dynocar::output::report_line;
use serde::Serialize;

use super::trial::{self, Trial, TrialPlan};
use crate::output::Failure;
use crate::rig::cores::in_thread;
use crate::rig::quantiles::{Quantiles, pooled};

/// A publisher that is later than this has itself reached its limit, in ns.
const PUBLISHER_LAG_NS: i64 = 50_000_000;
/// Steps of halving the interval, once a rate with loss is known.
const STEPS: usize = 5;
/// Rates beyond this are not tried, in Hz for each train.
const RATE_MAX_HZ: f64 = 2e6;

/// The outcome of a search.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Found {
    /// Highest rate of each train at which nothing was lost, in Hz; 0 when the first was too high.
    pub rate_hz: f64,
    /// The same over all trains.
    pub samples_per_s: f64,
    /// Lowest rate at which something was lost or the publishers fell behind, in Hz.
    pub failed_at_hz: Option<f64>,
    /// True when at that rate the publishers were at their limit, not the daemon.
    pub limited_by_publishers: bool,
}

/// Doubles the rate until something is lost, then halves the interval.
///
/// # Errors
///
/// When a process or channel fails.
pub fn highest_rate(plan: &TrialPlan) -> Result<Found, Failure> {
    let mut found = Found {
        rate_hz: 0.0,
        samples_per_s: 0.0,
        failed_at_hz: None,
        limited_by_publishers: false,
    };
    let mut steps = STEPS;
    let mut rate_hz = plan.traffic.rate_hz;
    while steps > 0 && rate_hz < RATE_MAX_HZ {
        let mut plan = plan.clone();
        plan.traffic.rate_hz = rate_hz;
        let trial = in_thread(|| trial::run(&plan))?;
        let is_late = trial.publisher_lag_ns > PUBLISHER_LAG_NS;
        let verdict = match (trial.missing() > 0, is_late) {
            (true, _) => "samples lost",
            (false, true) => "the publishers fall behind",
            (false, false) => "nothing lost",
        };
        report_line(&format!("{rate_hz:.0} Hz: {verdict}"));
        if trial.missing() > 0 || is_late {
            found.failed_at_hz = Some(rate_hz);
            found.limited_by_publishers = trial.missing() == 0;
        } else {
            found.rate_hz = rate_hz;
        }
        rate_hz = match found.failed_at_hz {
            None => rate_hz * 2.0,
            Some(failed) => {
                steps -= 1;
                0.5 * (found.rate_hz + failed)
            }
        };
    }
    found.samples_per_s = found.rate_hz * plan.trains as f64;
    Ok(found)
}

/// One size of the daemon's task.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Size {
    /// Number of trains.
    pub trains: u64,
    /// Number of pipelines.
    pub pipelines: usize,
    /// Samples without account.
    pub lost: u64,
    /// Latency over all pipelines.
    #[serde(flatten)]
    pub latency: Quantiles,
    /// Processor time of the daemon, in %.
    pub cpu_percent: f64,
    /// Resident memory of the daemon, in bytes.
    pub rss_bytes: u64,
}

/// Trials of one train up to the plan's number, with one pipeline, half and all of them.
///
/// # Errors
///
/// When a process or channel fails.
pub fn growth(plan: &TrialPlan) -> Result<Vec<Size>, Failure> {
    let mut counts = vec![1];
    while counts[counts.len() - 1] * 4 < plan.trains {
        counts.push(counts[counts.len() - 1] * 4);
    }
    if plan.trains > 1 {
        counts.push(plan.trains);
    }
    let all = plan.pipelines.len();
    let mut widths = vec![1, all.div_ceil(2), all];
    widths.dedup();
    let mut sizes = Vec::new();
    for &trains in &counts {
        for &width in &widths {
            let mut plan = plan.clone();
            plan.trains = trains;
            plan.pipelines.truncate(width);
            report_line(&format!("{trains} trains, {width} pipelines"));
            sizes.push(size(&plan, &in_thread(|| trial::run(&plan))?));
        }
    }
    Ok(sizes)
}

fn size(plan: &TrialPlan, trial: &Trial) -> Size {
    Size {
        trains: plan.trains,
        pipelines: plan.pipelines.len(),
        lost: trial.missing(),
        latency: Quantiles::of(&pooled(trial.pipelines.iter().map(|it| &it.latency))),
        cpu_percent: trial.cpu_percent,
        rss_bytes: trial.rss_bytes,
    }
}
