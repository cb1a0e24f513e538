//! A reported traction force that is not the true one: gain = reported over true.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

const PARAMETERS: [Parameter; 1] = [Parameter::new("gain", (0.6, 1.6), 0.005)];

/// A model of a train in one piece, over averages of 2 s, gives the force of a train of many cars
/// back to this share: root mean square over noise-free simulated runs.
const MODEL_ERROR: f64 = 0.0013;

/// The kind.
pub struct TractionGain;

#[derive(Debug)]
struct Gain;

impl Effect for TractionGain {
    fn kind(&self) -> EffectKind {
        EffectKind::TractionGain
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let pulling_s =
            scan.seconds_where(|_, sample| sample.traction_force_n.is_some_and(|f| f > 0.0));
        if pulling_s < 30.0 {
            return Proposal::NotTestable("the runs hold hardly any traction".into());
        }
        Proposal::Candidates(vec![Candidate::new(Gain, vec![1.0])])
    }
}

impl Hypothesis for Gain {
    fn kind(&self) -> EffectKind {
        EffectKind::TractionGain
    }

    fn parameters(&self) -> &[Parameter] {
        &PARAMETERS
    }

    fn none(&self) -> f64 {
        1.0
    }

    fn shared_error(&self) -> f64 {
        MODEL_ERROR
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        (parameters[0] - 1.0).abs() > 0.01
    }

    fn apply(&self, parameters: &[f64], _run: &RunData, forces: &mut [SampleForces]) {
        for force in forces {
            force.traction_n /= parameters[0];
        }
    }
}
