//! The highest rate without loss, and how things grow with trains and pipelines.

use dynocar::output::report_line;
use serde::Serialize;

use super::report;
use super::trial::{self, TrialPlan};
use crate::output::{Failure, Record};
use crate::rig::cores::in_thread;

/// A publisher that is later than this has itself reached its limit, in ns.
const PUBLISHER_LAG_NS: i64 = 50_000_000;
/// Steps of halving the interval, once a rate with loss is known.
const STEPS: usize = 5;
/// Rates beyond this are not tried, in Hz for each train.
const RATE_MAX_HZ: f64 = 2e6;

/// The outcome of a search.
#[derive(Clone, Copy, Debug, Default, Serialize)]
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
    let mut found = Found::default();
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

/// Trials of one train up to the plan's number, with one pipeline, half and all of them.
///
/// # Errors
///
/// When a process or channel fails.
pub fn growth(plan: &TrialPlan) -> Result<Vec<Record>, Failure> {
    let fours = std::iter::successors(Some(1), |trains| Some(4 * trains));
    let mut counts: Vec<u64> = fours.take_while(|&trains| trains < plan.trains).collect();
    counts.push(plan.trains);
    let all = plan.pipelines.len();
    let mut widths = vec![1, all.div_ceil(2), all];
    widths.dedup();
    let mut sizes = Vec::new();
    for &trains in &counts {
        for &width in &widths {
            let mut plan = TrialPlan { trains, ..plan.clone() };
            plan.pipelines.truncate(width);
            report_line(&format!("{trains} trains, {width} pipelines"));
            sizes.push(report::size(&plan, &in_thread(|| trial::run(&plan))?));
        }
    }
    Ok(sizes)
}
