//! Measured and predicted speeds of runs, thinned for drawing.

use dynocar_model::simulate::{Prediction, Restart};

use crate::dataset::Role;
use crate::explain::Explanation;
use crate::explain::evidence::{Fit, RunData, UpdatedForces};
use crate::explain::score::run_error;

use super::panels::{Zones, zones};

/// Runs shown at most.
const TRACES_MAX: usize = 3;
/// Points of a run at most.
const POINTS_MAX: usize = 450;

/// One instant of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    /// Time in s in the recording's own count.
    pub time_s: f64,
    /// Measured speed in m/s.
    pub measured_mps: f64,
    /// Predicted without the effects in m/s.
    pub before_mps: f64,
    /// Predicted with the effects in m/s.
    pub after_mps: f64,
}

/// One run, open loop from its first sample to its last and anew from each standstill.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The run's file.
    pub file: String,
    /// Fit or holdout.
    pub role: Role,
    /// Stretches without a break, in order of time.
    pub pieces: Vec<Vec<TracePoint>>,
    /// Root mean square errors of these predictions in m/s without and with the effects.
    pub rmse_mps: Option<[f64; 2]>,
    /// Stretches of time in s in which an effect acts.
    pub acting_s: Vec<[f64; 2]>,
}

/// The holdout runs with the greatest error before, the greatest first; fit runs when nothing was
/// held out.
pub fn traces(explanation: &Explanation) -> Vec<Trace> {
    let holdout = &explanation.holdout;
    let runs = if holdout.is_empty() { &explanation.problem.runs } else { holdout };
    let zones = zones(explanation);
    let mut ranked: Vec<(f64, &RunData)> = runs
        .iter()
        .map(|run| {
            let error = run_error(&explanation.base, run, Restart::AtDepartures);
            (error.rmse_mps().unwrap_or(0.0), run)
        })
        .collect();
    ranked.sort_by(|one, other| other.0.total_cmp(&one.0));
    ranked.iter().take(TRACES_MAX).map(|(_, run)| trace(explanation, run, &zones)).collect()
}

/// Speeds of a run predicted open loop from its first sample to its last, anew from each standstill.
pub(super) fn predicted(fit: &Fit, run: &RunData) -> Prediction {
    let (mut forces, mut prediction) = (UpdatedForces::default(), Prediction::new());
    fit.model.forces(run, &fit.theta, &mut forces);
    prediction.simulate(&run.recording, &forces, Restart::AtDepartures);
    prediction
}

fn trace(explanation: &Explanation, run: &RunData, zones: &Zones) -> Trace {
    let (before, after) = (predicted(&explanation.base, run), predicted(&explanation.grown, run));
    let (samples, time_s) = (run.samples(), run.recording.time_s());
    let every = samples.len().div_ceil(POINTS_MAX).max(1);
    let mut pieces: Vec<Vec<TracePoint>> = vec![Vec::new()];
    for i in (0..samples.len()).step_by(every) {
        if !run.recording.is_simulated(i) {
            if pieces.last().is_some_and(|piece| !piece.is_empty()) {
                pieces.push(Vec::new());
            }
            continue;
        }
        let point = TracePoint {
            time_s: run.offset_s + time_s[i],
            measured_mps: samples[i].speed_mps,
            before_mps: before.speed_mps()[i],
            after_mps: after.speed_mps()[i],
        };
        if let Some(piece) = pieces.last_mut() {
            piece.push(point);
        }
    }
    pieces.retain(|piece| piece.len() > 1);
    let rmse = |fit: &Fit| run_error(fit, run, Restart::AtDepartures).rmse_mps();
    Trace {
        file: run.file.clone(),
        role: run.role,
        pieces,
        rmse_mps: rmse(&explanation.base).zip(rmse(&explanation.grown)).map(|(b, a)| [b, a]),
        acting_s: zones.times_s(run),
    }
}
