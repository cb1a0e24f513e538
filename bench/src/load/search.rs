//! The highest rate without loss, and how latency, load and memory grow with trains and pipelines.

use dynocar::output::report_line;
use serde::Serialize;

use super::plan;
use super::plan::Load;
use crate::ending::is_due;
use crate::output::{BenchError, Record};

/// Controllers that are later than this have themselves reached their limit, in ns.
const LAG_MAX_NS: i64 = 50_000_000;
/// Steps of halving the interval, once a rate with loss is known.
const STEPS: usize = 5;
/// Rates beyond this are not tried, in Hz for each train.
const RATE_MAX_HZ: f64 = 2e6;

/// The outcome of a search.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct HighestRate {
    /// Highest rate of each train at which nothing was lost, in Hz; 0 when the first was too high.
    pub rate_hz: f64,
    /// The same over all trains.
    pub samples_per_s: f64,
    /// Lowest rate at which something was lost or the controllers fell behind, in Hz.
    pub failed_at_hz: Option<f64>,
}

/// Doubles the rate until something is lost, then halves the interval.
///
/// # Errors
///
/// When a process or channel fails.
pub fn highest_rate(load: &Load) -> Result<HighestRate, BenchError> {
    let mut found = HighestRate::default();
    let mut steps = STEPS;
    let mut load = load.clone();
    while steps > 0 && load.extent.traffic.rate_hz < RATE_MAX_HZ && !is_due() {
        let rate_hz = load.extent.traffic.rate_hz;
        let trial = load.run()?;
        if is_due() {
            break;
        }
        let verdict = match (trial.missing() > 0, trial.publisher_lag_ns > LAG_MAX_NS) {
            (true, _) => "samples lost",
            (false, true) => "the publishers fall behind",
            (false, false) => "nothing lost",
        };
        report_line(&format!("{rate_hz:.0} Hz: {verdict}"));
        if verdict == "nothing lost" {
            found.rate_hz = rate_hz;
        } else {
            found.failed_at_hz = Some(rate_hz);
        }
        load.extent.traffic.rate_hz = match found.failed_at_hz {
            None => rate_hz * 2.0,
            Some(failed) => {
                steps -= 1;
                0.5 * (found.rate_hz + failed)
            }
        };
    }
    found.samples_per_s = found.rate_hz * load.extent.trains as f64;
    Ok(found)
}

/// Trials of one train up to the load's number, with one pipeline, half and all of them.
///
/// # Errors
///
/// When a process or channel fails.
pub fn growth(load: &Load) -> Result<Vec<Record>, BenchError> {
    let most = load.extent.trains;
    let fours = std::iter::successors(Some(1), |trains| Some(4 * trains));
    let mut counts: Vec<u64> = fours.take_while(|&trains| trains < most).collect();
    counts.push(most);
    let all = load.pipelines.len();
    let mut widths = vec![1, all.div_ceil(2), all];
    widths.dedup();
    let mut sizes = Vec::new();
    for &trains in &counts {
        for &width in &widths {
            let mut load = load.clone();
            load.extent.trains = trains;
            load.pipelines.truncate(width);
            report_line(&format!("{trains} trains, {width} pipelines"));
            let trial = load.run()?;
            if is_due() {
                return Ok(sizes);
            }
            sizes.push(plan::size(&load, &trial));
        }
    }
    Ok(sizes)
}
