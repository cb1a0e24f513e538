//! A dead time, then a first-order lag: the law of late forces and of a late speed.

use dynocar_model::terms::Parameter;
use dynocar_shared::HALF_95;

use crate::explain::evidence::SampleForces;
use crate::explain::hypothesis::{On, ReportContext, ReportedValues};

/// Delay and lag in s near zero, from which a fit begins when all other starts are worse than no effect.
const NEAR_NONE_S: [f64; 2] = [0.05, 0.05];

/// Returns the delay and lag in s from which a fit begins: of some starts the one with the greatest decrease of the
/// cost.
pub fn late_from(starts_s: &[[f64; 2]], decrease: impl Fn([f64; 2]) -> f64) -> Vec<f64> {
    let each = starts_s.iter().map(|start_s| (decrease(*start_s), *start_s));
    let best = each.max_by(|one, other| one.0.total_cmp(&other.0));
    best.filter(|(decrease, _)| *decrease > 0.0).map_or(NEAR_NONE_S, |(_, start_s)| start_s).into()
}

/// Returns the standard deviation in s of a dead time, and of a lag that is as much shorter as this is longer, by the
/// sampling step. Forces are taken to change evenly between samples, so that each of the two may be wrong by any part of
/// a step; their sum, the mean lateness, is not.
pub fn late_by_sampling_s(step_s: f64) -> f64 {
    step_s / 12_f64.sqrt()
}

/// Returns a dead time and a lag, each with its standard deviation: neither is less than zero or more than both
/// together, however little the data distinguish one from the other.
pub fn late_reported(context: &ReportContext, parameters: &[Parameter]) -> ReportedValues {
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
