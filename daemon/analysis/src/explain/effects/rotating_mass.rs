//! Another rotating mass than declared: inertial mass = mass (1 + gamma). Unlike the mass, it does not change the force
//! of a gradient.

use dynocar_model::terms::rotating;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, DeclaredFigure, Hypothesis, Nature, On, OnOthers, Policy, Proposal};
use crate::explain::evidence::{RunScatter, SampleForces};
use crate::explain::scan::Scan;

#[derive(Debug)]
struct Gamma {
    declared: f64,
    /// Whether the runs show no difference from a scale of the traction force.
    is_like_traction: bool,
}

/// It estimates a figure that is usually a little wrong.
pub const POLICY: Policy = Policy { frees: &[DeclaredFigure::RotatingMass], ..Policy::USUAL };

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let declared = scan.train.rotating_mass_factor;
    let is_like_traction = scan.are_inertia_and_traction_alike();
    if is_like_traction && scan.fit.model.has(EffectKind::TractionGain) {
        return Err(
            "with a scale of the traction force found, only braking or a known gradient would show it".into(),
        );
    }
    Ok(vec![Candidate::new(Gamma { declared, is_like_traction }, vec![declared])])
}

impl Hypothesis for Gamma {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&rotating::FACTOR],
            none: self.declared,
            least: Some(rotating::LEAST),
            // Force sensors that are all a little off act as another inertia.
            shared_error: RunScatter::USUAL.force * (1.0 + self.declared),
            on_others: OnOthers::Scales,
            affine_in: Some(|gamma| 1.0 / (1.0 + gamma)),
            ..Nature::new(EffectKind::RotatingMass, &rotating::PARAMETERS)
        }
    }

    fn scale_of_others(&self, parameters: &[f64]) -> f64 {
        (1.0 + self.declared) / (1.0 + parameters[0])
    }

    fn twins(&self, _parameters: &[f64]) -> &'static [EffectKind] {
        if self.is_like_traction { &[EffectKind::TractionGain] } else { &[] }
    }

    fn apply(&self, parameters: &[f64], _on: On, forces: &mut [SampleForces]) {
        for force in forces {
            force.rotating_mass_factor = parameters[0];
        }
    }
}
