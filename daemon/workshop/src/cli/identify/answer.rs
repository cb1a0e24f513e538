//! Estimates of an estimator, machine-readable.

use std::collections::BTreeMap;

use dynocar_analysis::dataset::DatasetDiagnostic;
use dynocar_core::plausibility::Severity;
use dynocar_model::units::Unit;
use dynocar_shared::{Parameter, ParameterSnapshot, PipelineKind, Reason, RejectionReason, Status};
use serde::Serialize;

/// The parameter whose estimate scales with a force.
const MASS: &str = "mass_t";
/// Standard deviation of a load as a share of the declared mass.
const LOAD_STD: f64 = 0.1;
/// Standard deviations between the estimated and the declared mass beyond which no load explains the difference.
const DEVIATIONS_MAX: f64 = 3.0;
/// Approximate greatest number of speeds at which the resistance is shown.
const SHOWN_MAX: f64 = 7.0;

/// Estimates of one estimator.
#[derive(Clone, Debug, Serialize)]
pub(super) struct EstimatorAnswer {
    pub name: &'static str,
    pub status: &'static str,
    pub reason: &'static str,
    pub values: BTreeMap<&'static str, f64>,
    pub std: BTreeMap<&'static str, f64>,
    pub resistance: Vec<ResistancePoint>,
    /// The resistance at round speeds in the unit of the recording, for people.
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

/// Counts of the samples.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SampleCounts {
    pub used: u64,
    pub rejected: BTreeMap<&'static str, u32>,
    pub lost: u64,
}

impl EstimatorAnswer {
    /// Returns the answer of a snapshot.
    pub(super) fn new(kind: PipelineKind, snapshot: &ParameterSnapshot, speed_unit: Unit) -> Self {
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

    /// Says nothing but why: the data cannot be true.
    pub(super) fn refuse(&mut self, code: &'static str) {
        (self.status, self.reason) = (Status::Invalid.name(), code);
        self.values.clear();
        self.std.clear();
        self.resistance.clear();
        self.resistance_shown.clear();
    }

    /// Adds the relative uncertainty of a force to the standard deviation of the mass.
    pub(super) fn widen_mass(&mut self, share: f64) {
        let mass_t = self.values.get(MASS).copied().unwrap_or(0.0);
        if let Some(std) = self.std.get_mut(MASS) {
            *std = std.hypot(share * mass_t);
        }
    }

    /// Returns the note on an estimated mass that no load explains.
    pub(super) fn contradiction(&self, declared_kg: f64) -> Option<DatasetDiagnostic> {
        let (mass_t, declared_t) = (*self.values.get(MASS)?, declared_kg / 1000.0);
        let std_t = self.std.get(MASS)?.hypot(LOAD_STD * declared_t);
        let deviations = (mass_t - declared_t).abs() / std_t;
        (self.is_known() && deviations > DEVIATIONS_MAX).then(|| DatasetDiagnostic {
            code: "against_declared",
            severity: Severity::Warning,
            runs: Vec::new(),
            text: format!(
                "{} estimates {mass_t:.0} t, {deviations:.0} standard deviations from the declared \
                 {declared_t:.0} t, while {:.1} kN stay unexplained: is a force missing, a unit wrong or \
                 one of several columns taken for the whole?",
                self.name,
                self.unexplained_force_n / 1000.0
            ),
        })
    }

    /// Returns whether the values are more than the declared ones.
    pub(super) fn is_known(&self) -> bool {
        !["unestimated", "invalid"].contains(&self.status)
    }
}

/// Returns the resistance over the driven speeds in such steps.
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

/// Returns a step between round speeds in a unit that gives a handful of them.
fn shown_step_mps(snapshot: &ParameterSnapshot, speed_unit: Unit) -> f64 {
    let range = speed_unit.from_base(snapshot.speed_max_mps - snapshot.speed_min_mps);
    let steps = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
    let step = steps.into_iter().find(|step| range / step <= SHOWN_MAX).unwrap_or(100.0);
    speed_unit.to_base(step)
}
