//! Cold bearings that warm up: a grows by delta exp(-t / tau), t from the start of the run.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

const PARAMETERS: [Parameter; 2] = [
    Parameter::new("delta_a_n_per_kn", (0.0, 20.0), 0.02),
    Parameter::new("tau_s", (40.0, 3000.0), 5.0),
];

/// The kind.
pub struct BearingTemperature;

#[derive(Debug)]
struct Warming;

impl Effect for BearingTemperature {
    fn kind(&self) -> EffectKind {
        EffectKind::BearingTemperature
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let longest_s = scan.problem.runs.iter().map(RunData::duration_s).fold(0.0, f64::max);
        if longest_s < 240.0 {
            return Proposal::NotTestable("runs are too short for bearings to warm up".into());
        }
        let best = [80.0, 160.0, 300.0, 600.0, 1200.0]
            .into_iter()
            .map(|tau_s| {
                let tuple = scan.tuple(|run, i| {
                    let fade = (-run.recording.time_s()[i] / tau_s).exp();
                    -fade * scan.per_unit_resistance_mps2(&run.samples()[i])
                });
                let (gain, estimate) = scan.gain(&tuple);
                (if estimate > 0.0 { gain } else { 0.0 }, estimate, tau_s)
            })
            .max_by(|one, other| one.0.total_cmp(&other.0));
        let Some((_, delta, tau_s)) = best else { return Proposal::Candidates(Vec::new()) };
        Proposal::Candidates(vec![Candidate::new(Warming, vec![delta.clamp(0.05, 10.0), tau_s])])
    }
}

impl Hypothesis for Warming {
    fn kind(&self) -> EffectKind {
        EffectKind::BearingTemperature
    }

    fn parameters(&self) -> &[Parameter] {
        &PARAMETERS
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        for (force, time_s) in forces.iter_mut().zip(run.recording.time_s()) {
            force.extra_n_per_kn += parameters[0] * (-time_s / parameters[1]).exp();
        }
    }
}
