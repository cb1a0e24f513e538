//! Forces that act later than reported, traction and brake or the brake alone, and a measured speed that is late: each a
//! dead time, then a first-order lag.
//!
//! The gradient acts in time where only the forces are late, but seems late where the speed is: this distinguishes the
//! two, and so does a position that is ahead of the speed.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::{Key, Parameter, delay, speed_delay};
use dynocar_model::train::Davis;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;

use super::{
    Candidate, Certainty, DeclaredFigure, Everyday, Hypothesis, Nature, On, OnOthers, Policy,
    Proposal, ReportContext, ReportedValues, Turn,
};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

/// Delay and lag in s near zero, from which a fit begins when all other starts are worse than no effect.
const NEAR_NONE_S: [f64; 2] = [0.05, 0.05];

/// Returns the delay and lag in s from which a fit begins: of some starts the one with the greatest decrease of the
/// cost.
fn late_from(starts_s: &[[f64; 2]], decrease: impl Fn([f64; 2]) -> f64) -> Vec<f64> {
    let each = starts_s.iter().map(|start_s| (decrease(*start_s), *start_s));
    let best = each.max_by(|one, other| one.0.total_cmp(&other.0));
    best.filter(|(decrease, _)| *decrease > 0.0).map_or(NEAR_NONE_S, |(_, start_s)| start_s).into()
}

/// Returns the standard deviation in s of a dead time, and of a lag that is as much shorter as this is longer, by the
/// sampling step. Forces are taken to change evenly between samples, so that each of the two may be wrong by any part of
/// a step; their sum, the mean lateness, is not.
fn late_by_sampling_s(step_s: f64) -> f64 {
    step_s / 12_f64.sqrt()
}

/// Returns a dead time and a lag, each with its standard deviation: neither is less than zero or more than both
/// together, however little the data distinguish one from the other.
fn late_reported(context: &ReportContext, parameters: &[Parameter]) -> ReportedValues {
    let most_s = context.parameters.iter().sum::<f64>() + HALF_95 * context.deviation_of_sum();
    let mut reported = ReportedValues::default();
    for (parameter, (&value_s, &std_s)) in
        parameters.iter().zip(context.parameters.iter().zip(context.deviations))
    {
        let widest_s = value_s.max(most_s - value_s) / HALF_95;
        reported.push(parameter.name, value_s, std_s.min(widest_s));
    }
    reported
}

/// Which forces act late.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Late {
    /// Traction and brake.
    #[default]
    Both,
    /// The brake alone.
    Brake,
}

/// Forces that act behind a dead time and a lag in s.
pub fn late_forces(late: Late, delay_and_lag_s: [f64; 2], on: On, forces: &mut [SampleForces]) {
    let line = on.past.forces(delay_and_lag_s, on.first);
    for (force, &at) in forces.iter_mut().zip(&on.run.stamps[on.first..]) {
        if let Some([traction_n, brake_n]) =
            line.acting(at, Some([force.traction_n, force.brake_n]))
        {
            force.brake_n = brake_n;
            if late == Late::Both {
                force.traction_n = traction_n;
            }
        }
    }
}

/// Delays and lags in s from which a fit may start.
const FORCE_STARTS_S: [[f64; 2]; 4] = [[0.3, 0.3], [1.0, 1.0], [0.2, 2.0], [2.0, 0.3]];

#[derive(Debug)]
struct LateForces {
    late: Late,
    /// Where positions are integrated from the speed, they are late with it; where nothing of the line is felt,
    /// a speed whose odometer is late with it looks the same.
    may_be_speed: bool,
}

/// Every force acts a little late, and the usual errors hold a lateness; late forces are an error of the record.
pub const OF_FORCES: Policy = Policy {
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
    Ok(vec![candidate(scan, LateForces { late: Late::Brake, may_be_speed: false })])
}

/// Proposes a delay of both forces.
pub fn of_forces(scan: &Scan) -> Proposal {
    let is_any_recorded = scan.problem.runs.iter().any(|run| run.is_position_recorded);
    let is_level = scan.track.is_none_or(|track| track.is_level());
    let is_known = is_any_recorded && !is_level || scan.problem.is_position_ahead();
    Ok(vec![candidate(scan, LateForces { late: Late::Both, may_be_speed: !is_known })])
}

/// A delay and lag with the start that explains most.
fn candidate(scan: &Scan, of: LateForces) -> Candidate {
    let decrease = |start: [f64; 2]| {
        scan.decrease_by(&of, &start, |run, i, [declared, late]| {
            let control_n = |force: &SampleForces| force.traction_n - force.brake_n;
            (control_n(late) - control_n(declared)) / run.samples()[i].inertial_mass_kg
        })
    };
    let start = late_from(&FORCE_STARTS_S, decrease);
    Candidate::new(of, start)
}

impl Hypothesis for LateForces {
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

/// Delays and lags in s from which a fit may start.
const SPEED_STARTS_S: [[f64; 2]; 4] = [[0.6, 0.1], [0.1, 0.6], [1.2, 0.3], [0.3, 1.2]];

#[derive(Debug)]
struct LateSpeed;

/// Late forces look like a late speed, so it is never certain.
pub const OF_SPEED: Policy = Policy {
    certainty: Certainty::Never,
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 4, most: f64::INFINITY }),
    is_late: true,
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn of_speed(scan: &Scan) -> Proposal {
    if !scan.problem.runs.iter().any(|run| run.is_position_recorded) {
        return Err(
            "positions are integrated from the speed and late with it, so that forces that act \
             late look the same"
                .into(),
        );
    }
    let start = late_from(&SPEED_STARTS_S, |start| decrease(scan, start));
    Ok(vec![Candidate::new(LateSpeed, start)])
}

/// Decrease of the cost when the speed is late by this delay and lag.
fn decrease(scan: &Scan, start: [f64; 2]) -> f64 {
    let theta = &scan.fit.theta;
    let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
    scan.decrease_by(&LateSpeed, &start, |run, i, [declared, late]| {
        let speed_mps = run.smooth_mps[i];
        let mps2 = |force: &SampleForces| {
            let [p0, p1, p2] = force.polynomial(davis, speed_mps);
            p0 + speed_mps * (p1 + speed_mps * p2)
        };
        mps2(late) - mps2(declared)
    })
}

impl Hypothesis for LateSpeed {
    fn nature(&self) -> Nature<'_> {
        Nature {
            keys: &[&speed_delay::DELAY, &speed_delay::LAG],
            turn: Turn::Last,
            on_others: OnOthers::Changes,
            looks_back: true,
            ..Nature::new(EffectKind::SpeedDelay, &speed_delay::PARAMETERS)
        }
    }

    fn sampling_error(&self, step_s: f64) -> f64 {
        late_by_sampling_s(step_s)
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0] + parameters[1] > speed_delay::LEAST_S
    }

    fn apply(&self, parameters: &[f64], on: On, forces: &mut [SampleForces]) {
        let On { run, first, past } = on;
        let late = past.speed([parameters[0], parameters[1]], first);
        let speeds_mps = &run.covariate(Covariate::Speed)[first..];
        for (force, (&at, &speed_mps)) in
            forces.iter_mut().zip(run.stamps[first..].iter().zip(speeds_mps))
        {
            let now = Some([force.traction_n, force.brake_n]);
            if let Some(acting) = late.forces(at, speed_mps, now) {
                [force.traction_n, force.brake_n] = acting;
            }
            (force.gradient_permille, force.resistance) =
                late.resisting(at, (force.gradient_permille, force.resistance));
        }
    }

    fn report(&self, context: &ReportContext) -> ReportedValues {
        late_reported(context, self.parameters())
    }

    fn speed_late_s(&self, parameters: &[f64]) -> Option<f64> {
        Some(parameters.iter().sum())
    }
}

#[cfg(test)]
mod tests {
    use dynocar_model::terms::delay;
    use nalgebra::DMatrix;

    use super::*;
    use crate::explain::answer::ParameterValue;

    #[test]
    fn neither_a_dead_time_nor_a_lag_is_more_than_both_or_less_than_none() {
        // The sum of the two is known to 0.1 s, either to 2 s.
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, -3.995, -3.995, 4.0]);
        let context = ReportContext {
            parameters: &[0.2, 0.1],
            deviations: &[2.0, 2.0],
            c: 0.0,
            c_deviation: 0.0,
            covariance: &covariance,
            first: 0,
            weight_kn: 1.0,
            few_runs_factor: 1.0,
        };
        let reported = late_reported(&context, &delay::PARAMETERS);
        let std_s = |name: &str| match reported.deviations[name] {
            ParameterValue::Number(std_s) => std_s,
            _ => panic!("{name} is a number"),
        };
        let most_s = 0.3 + HALF_95 * 0.1;
        assert!((std_s("delay_s") - (most_s - 0.2) / HALF_95).abs() < 1e-9);
        assert!((std_s("lag_s") - (most_s - 0.1) / HALF_95).abs() < 1e-9);
    }
}
