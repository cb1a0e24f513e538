//! What an estimator learned, machine-readable.

use std::collections::BTreeMap;

use dynocar_model::units::Unit;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason};
use serde::Serialize;

/// At so many speeds, or a few more, the resistance is shown.
const SHOWN_MAX: f64 = 7.0;

/// What one estimator learned.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EstimatorAnswer {
    pub name: &'static str,
    pub status: &'static str,
    pub reason: &'static str,
    pub values: BTreeMap<&'static str, f64>,
    pub std: BTreeMap<&'static str, f64>,
    pub resistance: Vec<ResistancePoint>,
    /// At round speeds in the unit of the recording, for people.
    #[serde(skip)]
    pub resistance_shown: Vec<ResistancePoint>,
    pub samples: SampleCounts,
    pub updates: u64,
    pub innovation_mean_square: f64,
    pub innovation_correlation: f64,
    pub unexplained_force_n: f64,
    pub unexplained_force_std_n: f64,
}

/// Basic resistance at a speed.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct ResistancePoint {
    pub speed_mps: f64,
    pub w0_n_per_kn: f64,
    pub std: f64,
}

/// What became of the samples.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SampleCounts {
    pub used: u64,
    pub rejected: BTreeMap<&'static str, u32>,
    pub lost: u64,
}

impl EstimatorAnswer {
    /// What a snapshot says.
    pub(super) fn of(kind: PipelineKind, snapshot: &ParameterSnapshot, speed_unit: Unit) -> Self {
        let parameters = || Parameter::ALL.iter().filter(|&&it| snapshot.index_of(it).is_some());
        EstimatorAnswer {
            name: kind.name(),
            status: snapshot.status().name(),
            reason: snapshot.reason().unwrap_or(Reason::None).name(),
            values: parameters().filter_map(|&it| Some((it.name(), snapshot.value(it)?))).collect(),
            std: parameters().filter_map(|&it| Some((it.name(), snapshot.std(it)?))).collect(),
            resistance: resistance_points(snapshot, 1.0),
            resistance_shown: resistance_points(snapshot, shown_step_mps(snapshot, speed_unit)),
            samples: SampleCounts {
                used: snapshot.samples_used,
                rejected: RejectionReason::ALL
                    .iter()
                    .map(|&reason| (reason.name(), snapshot.rejected(reason)))
                    .filter(|&(_, count)| count > 0)
                    .collect(),
                lost: snapshot.samples_lost,
            },
            updates: snapshot.updates,
            innovation_mean_square: snapshot.innovation_mean_square,
            innovation_correlation: snapshot.innovation_correlation,
            unexplained_force_n: snapshot.unexplained_force_n,
            unexplained_force_std_n: snapshot.unexplained_force_std_n,
        }
    }

    /// True when the values are more than the declared ones.
    pub(super) fn is_known(&self) -> bool {
        !["unestimated", "invalid"].contains(&self.status)
    }
}

/// Resistance over the driven speeds in such steps.
fn resistance_points(snapshot: &ParameterSnapshot, step_mps: f64) -> Vec<ResistancePoint> {
    let (low_mps, high_mps) = (snapshot.speed_min_mps, snapshot.speed_max_mps);
    let (first, last) = ((low_mps / step_mps).ceil() as u32, (high_mps / step_mps).floor() as u32);
    (first..=last)
        .filter_map(|count| {
            let speed_mps = f64::from(count) * step_mps;
            let estimate = snapshot.resistance_at(speed_mps)?;
            Some(ResistancePoint {
                speed_mps,
                w0_n_per_kn: estimate.w0_n_per_kn,
                std: estimate.w0_std_n_per_kn,
            })
        })
        .collect()
}

/// A step between round speeds in a unit that gives a handful of them.
fn shown_step_mps(snapshot: &ParameterSnapshot, speed_unit: Unit) -> f64 {
    let range = speed_unit.from_base(snapshot.speed_max_mps - snapshot.speed_min_mps);
    let steps = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
    let step = steps.into_iter().find(|step| range / step <= SHOWN_MAX).unwrap_or(100.0);
    speed_unit.to_base(step)
}
