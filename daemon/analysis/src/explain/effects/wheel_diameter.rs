//! Wheels of another diameter than declared: measured speed = scale * true speed, and the odometer has the same scale.
//! Balises, which correct the position, distinguish this effect from the rotating mass.

use dynocar_model::terms::wheel;
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Everyday, Hypothesis, Nature, On, OnOthers, Policy, Proposal};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

#[derive(Debug)]
struct Scale;

/// Wheels wear: an error of the record that every train has.
pub const POLICY: Policy = Policy {
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 2, most: f64::INFINITY }),
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    if scan.problem.positions.distance_ratio.is_none() {
        return Err("no measured positions to compare the speed with".into());
    }
    Ok(vec![Candidate::new(Scale, vec![1.0])])
}

impl Hypothesis for Scale {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&wheel::SPEED_SCALE],
            none: 1.0,
            least: Some(wheel::LEAST),
            on_others: OnOthers::Scales,
            changes_speed_scale: true,
            ..Nature::new(EffectKind::WheelDiameter, &wheel::PARAMETERS)
        }
    }

    fn scale_of_others(&self, parameters: &[f64]) -> f64 {
        parameters[0]
    }

    /// The speed scale does it.
    fn apply(&self, _parameters: &[f64], _on: On, _forces: &mut [SampleForces]) {}

    fn speed_scale(&self, parameters: &[f64]) -> f64 {
        parameters[0]
    }
}
