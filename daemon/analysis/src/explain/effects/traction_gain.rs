//! A reported traction force that is not the true one: gain = reported over true.

use dynocar_model::terms::{Entry, Parameter, traction};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

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

    fn whole(&self, scan: &Scan) -> Option<Candidate> {
        self.propose(scan).first()
    }
}

impl Hypothesis for Gain {
    fn kind(&self) -> EffectKind {
        EffectKind::TractionGain
    }

    fn parameters(&self) -> &[Parameter] {
        &traction::PARAMETERS
    }

    fn none(&self) -> f64 {
        1.0
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        (parameters[0] - 1.0).abs() > traction::LEAST
    }

    fn affine_in(&self) -> Option<fn(f64) -> f64> {
        Some(f64::recip)
    }

    fn apply(
        &self,
        parameters: &[f64],
        _run: &RunData,
        _first: usize,
        forces: &mut [SampleForces],
    ) {
        for force in forces {
            force.traction_n = traction::true_force_n(force.traction_n, parameters[0]);
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        Some(vec![Entry::Number(&traction::GAIN, parameters[0])])
    }
}
