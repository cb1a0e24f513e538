//! When the traction of a braked train was gone.

use dynocar_shared::{SampleField, TrainSample};
use serde::Serialize;

use crate::dataset::ForceSource;
use crate::statistics::span;

/// Share of a run's greatest traction force from which on a train is driven...
const DRIVEN: f64 = 0.1;
/// ... and share of the force at the brake's command below which it is gone.
const GONE: f64 = 0.05;

/// T_traction_cut_off of some stops.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CutOff {
    /// Stops under whose command the train was still driven.
    pub stops: usize,
    /// Shortest time in s.
    pub least_s: f64,
    /// Longest time in s.
    pub greatest_s: f64,
}

impl CutOff {
    /// That of some times; `None` without one.
    pub fn of(times_s: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let [least_s, greatest_s] = span(times_s.clone())?;
        Some(CutOff { stops: times_s.count(), least_s, greatest_s })
    }
}

/// Time in s from a sample, that of the brake's command, to the first without traction; `None` where the force is not
/// recorded, did not act at the command, or did not go. A handle is no force.
pub fn cut_off_s(samples: &[TrainSample], command: usize, source: ForceSource) -> Option<f64> {
    if matches!(source, ForceSource::Handle | ForceSource::None) {
        return None;
    }
    let force_n = |sample: &TrainSample| sample.get(SampleField::TractionForce);
    let greatest_n = samples.iter().filter_map(force_n).fold(0.0, f64::max);
    let driven_n = force_n(&samples[command])?;
    if driven_n <= 0.0 || driven_n < DRIVEN * greatest_n {
        return None;
    }
    let gone = samples[command..]
        .iter()
        .find(|it| force_n(it).is_some_and(|force_n| force_n <= GONE * driven_n))?;
    Some(1e-9 * (gone.time_ns - samples[command].time_ns) as f64)
}
