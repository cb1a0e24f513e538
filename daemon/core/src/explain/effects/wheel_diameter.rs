//! Wheels of another diameter than declared: measured speed = scale * true speed, and the odometer
//! with it. Balises tell it from the rotating mass: they correct the position.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// Wheels are turned down by at most about a tenth of their diameter.
const PARAMETERS: [Parameter; 1] = [Parameter::new("speed_scale", (0.88, 1.12), 0.002)];

/// The kind.
pub struct WheelDiameter;

#[derive(Debug)]
struct Scale;

impl Effect for WheelDiameter {
    fn kind(&self) -> EffectKind {
        EffectKind::WheelDiameter
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        if scan.problem.way_ratio.is_none() {
            return Proposal::NotTestable("no measured positions to compare the speed with".into());
        }
        Proposal::Candidates(vec![Candidate::new(Scale, vec![1.0])])
    }
}

impl Hypothesis for Scale {
    fn kind(&self) -> EffectKind {
        EffectKind::WheelDiameter
    }

    fn parameters(&self) -> &[Parameter] {
        &PARAMETERS
    }

    fn none(&self) -> f64 {
        1.0
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        (parameters[0] - 1.0).abs() > 0.003
    }

    fn apply(&self, _parameters: &[f64], _run: &RunData, _forces: &mut [SampleForces]) {}

    fn speed_scale(&self, parameters: &[f64]) -> f64 {
        parameters[0]
    }

    fn changes_speed_scale(&self) -> bool {
        true
    }
}
