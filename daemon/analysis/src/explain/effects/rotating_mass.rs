//! Another rotating mass than declared: inertial mass = mass (1 + gamma). Unlike the mass it does
//! not feel the gradient.

use dynocar_model::terms::{Entry, Parameter, rotating};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, OnOthers, Proposal};
use crate::explain::evidence::{RunData, RunScatter, SampleForces};
use crate::explain::scan::Scan;

/// The kind.
pub struct RotatingMass;

#[derive(Debug)]
struct Gamma {
    declared: f64,
}

impl Effect for RotatingMass {
    fn kind(&self) -> EffectKind {
        EffectKind::RotatingMass
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let declared = scan.train.rotating_mass_factor;
        Proposal::Candidates(vec![Candidate::new(Gamma { declared }, vec![declared])])
    }

    fn whole(&self, scan: &Scan) -> Option<Candidate> {
        self.propose(scan).first()
    }
}

impl Hypothesis for Gamma {
    fn kind(&self) -> EffectKind {
        EffectKind::RotatingMass
    }

    fn parameters(&self) -> &[Parameter] {
        &rotating::PARAMETERS
    }

    fn none(&self) -> f64 {
        self.declared
    }

    /// Force sensors that are all a little off act as another inertia.
    fn shared_error(&self) -> f64 {
        RunScatter::USUAL.force * (1.0 + self.declared)
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        (parameters[0] - self.declared).abs() > rotating::LEAST
    }

    fn on_others(&self) -> OnOthers {
        OnOthers::Scales
    }

    fn scale_of_others(&self, parameters: &[f64]) -> f64 {
        (1.0 + self.declared) / (1.0 + parameters[0])
    }

    fn affine_in(&self) -> Option<fn(f64) -> f64> {
        Some(|gamma| 1.0 / (1.0 + gamma))
    }

    fn apply(
        &self,
        parameters: &[f64],
        _run: &RunData,
        _first: usize,
        forces: &mut [SampleForces],
    ) {
        for force in forces {
            force.rotating_mass_factor = parameters[0];
        }
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        Some(vec![Entry::Number(&rotating::FACTOR, parameters[0])])
    }
}
