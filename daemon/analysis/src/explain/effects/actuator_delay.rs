//! Forces that act later than reported, traction and brake or the brake alone: a dead time, then a first-order lag.

use dynocar_model::terms::{Key, delay, speed_delay};
use dynocar_shared::vocabulary::EffectKind;

use super::lateness::{Late, late_by_sampling_s, late_forces, late_from, late_reported};
use super::{
    Candidate, DeclaredFigure, Everyday, Hypothesis, Nature, On, Policy, Proposal, ReportContext,
    ReportedValues, Turn,
};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

/// Delays and lags in s from which a fit may start.
const STARTS: [[f64; 2]; 4] = [[0.3, 0.3], [1.0, 1.0], [0.2, 2.0], [2.0, 0.3]];

#[derive(Debug)]
struct DelayAndLag {
    late: Late,
    /// Where positions are integrated from the speed, they are late with it; where nothing of the line is felt,
    /// a speed whose odometer is late with it looks the same.
    may_be_speed: bool,
}

/// Every force acts a little late, and the usual errors hold a lateness; late forces are an error of the record.
pub const POLICY: Policy = Policy {
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 1, most: f64::INFINITY }),
    is_late: true,
    frees: &[DeclaredFigure::Lateness],
    ..Policy::USUAL
};

/// A late brake is an error of the record, as late forces are; of the small ones the usual errors hold a part.
pub const OF_BRAKE: Policy =
    Policy { is_sought_with_nuisance: false, is_late: true, ..Policy::USUAL };

/// Proposes a delay of the brake alone.
pub fn of_brake(scan: &Scan) -> Proposal {
    scan.requires_force(|sample| sample.brake_force_n, "braking")?;
    Ok(vec![candidate(scan, DelayAndLag { late: Late::Brake, may_be_speed: false })])
}

/// Proposes a delay of both forces.
pub fn of_both(scan: &Scan) -> Proposal {
    let is_any_recorded = scan.problem.runs.iter().any(|run| run.is_position_recorded);
    let is_level = scan.track.is_none_or(|track| track.is_level());
    let is_known = is_any_recorded && !is_level || scan.problem.is_position_ahead();
    Ok(vec![candidate(scan, DelayAndLag { late: Late::Both, may_be_speed: !is_known })])
}

/// A delay and lag with the start that explains most.
fn candidate(scan: &Scan, of: DelayAndLag) -> Candidate {
    let decrease = |start: [f64; 2]| {
        scan.decrease_by(&of, &start, |run, i, [declared, late]| {
            let control_n = |force: &SampleForces| force.traction_n - force.brake_n;
            (control_n(late) - control_n(declared)) / run.samples()[i].inertial_mass_kg
        })
    };
    let start = late_from(&STARTS, decrease);
    Candidate::new(of, start)
}

impl Hypothesis for DelayAndLag {
    fn nature(&self) -> Nature<'_> {
        const BOTH: &[&Key] = &[&delay::DELAY, &delay::LAG];
        const BRAKE: &[&Key] = &[&delay::BRAKE_DELAY, &delay::BRAKE_LAG];
        let (kind, keys) = match self.late {
            Late::Both => (EffectKind::ActuatorDelay, BOTH),
            Late::Brake => (EffectKind::BrakeDelay, BRAKE),
        };
        Nature {
            keys,
            turn: Turn::First,
            looks_back: true,
            ..Nature::new(kind, &delay::PARAMETERS)
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
        late_forces(self.late, [parameters[0], parameters[1]], on, forces);
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        let mut reported = late_reported(context, self.parameters());
        let together_s = context.parameters.iter().sum();
        reported.push(delay::TOGETHER, together_s, context.deviation_of_sum());
        reported
    }
}
