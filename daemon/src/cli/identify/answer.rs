//! What an estimator learned, machine-readable.

use std::collections::BTreeMap;

use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason};
use serde::Serialize;

/// What one estimator learned.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EstimatorAnswer {
    pub name: &'static str,
    pub status: &'static str,
    pub reason: &'static str,
    pub values: BTreeMap<&'static str, f64>,
    pub std: BTreeMap<&'static str, f64>,
    pub resistance: Vec<ResistancePoint>,
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
    pub(super) fn of(kind: PipelineKind, snapshot: &ParameterSnapshot) -> Self {
        let parameters = || Parameter::ALL.iter().filter(|&&it| snapshot.index_of(it).is_some());
        EstimatorAnswer {
            name: kind.name(),
            status: snapshot.status().name(),
            reason: snapshot.reason().unwrap_or(Reason::None).name(),
            values: parameters().filter_map(|&it| Some((it.name(), snapshot.value(it)?))).collect(),
            std: parameters().filter_map(|&it| Some((it.name(), snapshot.std(it)?))).collect(),
            resistance: resistance_points(snapshot),
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

/// Resistance over the driven speeds in steps of 1 m/s.
fn resistance_points(snapshot: &ParameterSnapshot) -> Vec<ResistancePoint> {
    let (low, high) = (snapshot.speed_min_mps.ceil() as u32, snapshot.speed_max_mps.floor() as u32);
    (low..=high)
        .filter_map(|speed_mps| {
            let speed_mps = f64::from(speed_mps);
            let estimate = snapshot.resistance_at(speed_mps)?;
            Some(ResistancePoint {
                speed_mps,
                w0_n_per_kn: estimate.w0_n_per_kn,
                std: estimate.w0_std_n_per_kn,
            })
        })
        .collect()
}
