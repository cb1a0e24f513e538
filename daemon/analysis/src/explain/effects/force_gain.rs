//! A reported traction or brake force that differs from the true one: gain = reported over true.

use dynocar_model::terms::{Key, brake, traction};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, DeclaredFigure, Everyday, Hypothesis, Nature, On, Policy, Proposal};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

#[derive(Clone, Copy, Debug)]
enum Gain {
    Traction {
        /// Whether the runs show no difference from another inertia.
        is_like_inertia: bool,
    },
    Brake,
}

/// Force sensors have small errors: an error of the record that every train has.
pub const OF_TRACTION: Policy = Policy {
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 3, most: f64::INFINITY }),
    frees: &[DeclaredFigure::Traction],
    ..Policy::USUAL
};
/// A brake is everyday some per cent weaker or stronger than reported. Another mass with another scale of the traction
/// looks the same.
pub const OF_BRAKE: Policy = Policy {
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 3, most: f64::INFINITY }),
    frees: &[DeclaredFigure::Brake],
    ..Policy::USUAL
};

/// Proposes a gain of the traction force.
pub fn of_traction(scan: &Scan) -> Proposal {
    scan.requires_force(|sample| sample.traction_force_n, "traction")?;
    scan.requires_known_loads()?;
    let is_like_inertia = scan.are_inertia_and_traction_alike();
    if is_like_inertia && scan.fit.model.has(EffectKind::RotatingMass) {
        return Err(
            "with another rotating mass found, only braking or a known gradient would show it"
                .into(),
        );
    }
    Ok(vec![Candidate::new(Gain::Traction { is_like_inertia }, vec![1.0])])
}

/// Proposes a gain of the brake force.
pub fn of_brake(scan: &Scan) -> Proposal {
    scan.requires_force(|sample| sample.brake_force_n, "braking")?;
    Ok(vec![Candidate::new(Gain::Brake, vec![1.0])])
}

impl Hypothesis for Gain {
    fn nature(&self) -> Nature<'_> {
        const TRACTION: &[&Key] = &[&traction::GAIN];
        const BRAKE: &[&Key] = &[&brake::GAIN];
        let (kind, keys, least) = match self {
            Gain::Traction { .. } => (EffectKind::TractionGain, TRACTION, traction::LEAST),
            Gain::Brake => (EffectKind::BrakeGain, BRAKE, brake::GAIN_LEAST),
        };
        Nature {
            keys,
            none: 1.0,
            least: Some(least),
            affine_in: Some(f64::recip),
            ..Nature::new(kind, &traction::PARAMETERS)
        }
    }

    fn twins(&self, _parameters: &[f64]) -> &'static [EffectKind] {
        match self {
            Gain::Traction { is_like_inertia: true } => &[EffectKind::RotatingMass],
            _ => &[],
        }
    }

    fn apply(&self, parameters: &[f64], _on: On, forces: &mut [SampleForces]) {
        for force in forces {
            let reported_n = match self {
                Gain::Traction { .. } => &mut force.traction_n,
                Gain::Brake => &mut force.brake_n,
            };
            *reported_n = traction::true_force_n(*reported_n, parameters[0]);
        }
    }
}
