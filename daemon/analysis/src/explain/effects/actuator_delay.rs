//! Forces that act later than reported: a dead time, then a first-order lag.

use dynocar_model::terms::{delay, speed_delay};
use dynocar_shared::vocabulary::EffectKind;

use super::lateness::{late_by_sampling_s, late_forces, late_from, late_reported};
use super::{
    Candidate, Everyday, Figure, Hypothesis, Nature, On, Policy, Proposal, ReportContext, Reported,
    Turn,
};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

/// Delay and lag in s that a fit may start from.
const STARTS: [[f64; 2]; 4] = [[0.3, 0.3], [1.0, 1.0], [0.2, 2.0], [2.0, 0.3]];

#[derive(Debug, Default)]
struct DelayAndLag {
    /// Where positions are integrated from the speed, they are late with it; where nothing of the line is felt,
    /// a speed whose odometer is late with it looks the same.
    may_be_speed: bool,
}

/// Every force acts a little late, and the usual errors hold a lateness; late forces are an error of the record.
pub const POLICY: Policy = Policy {
    is_sought_beside_usual_errors: false,
    everyday: Some(Everyday { rank: 1, most: f64::INFINITY }),
    is_late: true,
    frees: &[Figure::Lateness],
    ..Policy::USUAL
};

/// Structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    let start = late_from(&STARTS, |start| decrease(scan, start));
    let is_any_recorded = scan.problem.runs.iter().any(|run| run.is_position_recorded);
    let is_level = scan.track.is_none_or(|track| track.is_level());
    let is_known = is_any_recorded && !is_level || scan.problem.is_position_ahead();
    Ok(vec![Candidate::new(DelayAndLag { may_be_speed: !is_known }, start)])
}

/// Decrease of the cost when the forces act with this delay and lag.
fn decrease(scan: &Scan, start: [f64; 2]) -> f64 {
    scan.decrease_by(&DelayAndLag::default(), &start, |run, i, [declared, late]| {
        let control_n = |force: &SampleForces| force.traction_n - force.brake_n;
        (control_n(late) - control_n(declared)) / run.samples()[i].inertial_mass_kg
    })
}

impl Hypothesis for DelayAndLag {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&delay::DELAY, &delay::LAG],
            turn: Turn::First,
            looks_back: true,
            ..Nature::of(EffectKind::ActuatorDelay, &delay::PARAMETERS)
        }
    }

    fn sampling_error(&self, step_s: f64) -> f64 {
        late_by_sampling_s(step_s)
    }

    fn twins(&self, parameters: &[f64]) -> &'static [EffectKind] {
        // A late speed of less would be within usual errors itself.
        let is_large = parameters.iter().sum::<f64>() > speed_delay::LEAST_S;
        if self.may_be_speed && is_large { &[EffectKind::SpeedDelay] } else { &[] }
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0] + parameters[1] > delay::LEAST_S
    }

    fn apply(&self, parameters: &[f64], on: On, forces: &mut [SampleForces]) {
        late_forces([parameters[0], parameters[1]], on, forces);
    }

    fn report(&self, context: &ReportContext) -> Reported {
        let mut reported = late_reported(context, self.parameters());
        let together_s = context.parameters.iter().sum();
        reported.push(delay::TOGETHER, together_s, context.deviation_of_sum());
        reported
    }
}
