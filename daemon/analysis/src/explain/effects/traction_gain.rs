//! A reported traction force that is not the true one: gain = reported over true.

use dynocar_model::terms::traction;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Everyday, Figure, Hypothesis, Nature, On, Policy, Proposal};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

#[derive(Debug)]
struct Gain;

/// Force sensors are a little off: an error of the record that every train has.
pub const POLICY: Policy = Policy {
    is_sought_beside_usual_errors: false,
    everyday: Some(Everyday { rank: 3, most: f64::INFINITY }),
    frees: &[Figure::Traction],
    ..Policy::USUAL
};

/// Structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let pulling_s =
        scan.seconds_where(|_, sample| sample.traction_force_n.is_some_and(|f| f > 0.0));
    if pulling_s < 30.0 {
        return Err("the runs hold hardly any traction".into());
    }
    Ok(vec![Candidate::new(Gain, vec![1.0])])
}

impl Hypothesis for Gain {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&traction::GAIN],
            none: 1.0,
            least: Some(traction::LEAST),
            affine_in: Some(f64::recip),
            ..Nature::of(EffectKind::TractionGain, &traction::PARAMETERS)
        }
    }

    fn apply(&self, parameters: &[f64], _on: On, forces: &mut [SampleForces]) {
        for force in forces {
            force.traction_n = traction::true_force_n(force.traction_n, parameters[0]);
        }
    }
}
