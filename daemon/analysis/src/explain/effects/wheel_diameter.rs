//! Wheels of another diameter than declared: measured speed = scale * true speed, and the odometer
//! with it. Balises distinguish it from the rotating mass: they correct the position.

use dynocar_model::terms::{Entry, Parameter, wheel};
use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, OnOthers, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// The kind.
pub struct WheelDiameter;

#[derive(Debug)]
struct Scale;

impl Effect for WheelDiameter {
    fn kind(&self) -> EffectKind {
        EffectKind::WheelDiameter
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        if scan.problem.distance_ratio.is_none() {
            return Proposal::NotTestable("no measured positions to compare the speed with".into());
        }
        Proposal::Candidates(vec![Candidate::new(Scale, vec![1.0])])
    }

    fn whole(&self, scan: &Scan) -> Option<Candidate> {
        self.propose(scan).first()
    }
}

impl Hypothesis for Scale {
    fn kind(&self) -> EffectKind {
        EffectKind::WheelDiameter
    }

    fn parameters(&self) -> &[Parameter] {
        &wheel::PARAMETERS
    }

    fn none(&self) -> f64 {
        1.0
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        (parameters[0] - 1.0).abs() > wheel::LEAST
    }

    fn on_others(&self) -> OnOthers {
        OnOthers::Scales
    }

    fn scale_of_others(&self, parameters: &[f64]) -> f64 {
        parameters[0]
    }

    fn apply(
        &self,
        _parameters: &[f64],
        _run: &RunData,
        _first: usize,
        _forces: &mut [SampleForces],
    ) {
    }

    fn speed_scale(&self, parameters: &[f64]) -> f64 {
        parameters[0]
    }

    fn changes_speed_scale(&self) -> bool {
        true
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        Some(vec![Entry::Number(&wheel::SPEED_SCALE, parameters[0])])
    }
}
