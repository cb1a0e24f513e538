//! Forces that act later than reported: a dead time, then a first-order lag.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal};
use crate::explain::evidence::{Fade, RunData, SampleForces};
use crate::explain::scan::{Scan, Tuple};

const PARAMETERS: [Parameter; 2] =
    [Parameter::new("delay_s", (0.0, 6.0), 0.05), Parameter::new("lag_s", (0.0, 8.0), 0.05)];

/// Delay and lag in s that a fit may start from.
const STARTS: [[f64; 2]; 4] = [[0.3, 0.3], [1.0, 1.0], [0.2, 2.0], [2.0, 0.3]];

/// The kind.
pub struct ActuatorDelay;

#[derive(Debug)]
struct DelayAndLag;

impl Effect for ActuatorDelay {
    fn kind(&self) -> EffectKind {
        EffectKind::ActuatorDelay
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        let best = STARTS
            .into_iter()
            .map(|start| (decrease(scan, start), start))
            .max_by(|one, other| one.0.total_cmp(&other.0));
        let candidate = |(_, start): (f64, [f64; 2])| Candidate::new(DelayAndLag, start.to_vec());
        Proposal::Candidates(best.map(candidate).into_iter().collect())
    }
}

/// Decrease of the cost when the forces act with this delay and lag.
fn decrease(scan: &Scan, [delay_s, lag_s]: [f64; 2]) -> f64 {
    let mut sum = Tuple::zero(scan.fit.theta.len());
    for (index, run) in scan.problem.runs.iter().enumerate() {
        let reported: Vec<Forces> =
            run.declared.iter().map(|force| [force.traction_n, force.brake_n]).collect();
        let late = delayed(run.recording.time_s(), &reported, delay_s, lag_s);
        let control_n = |[traction_n, brake_n]: Forces| traction_n - brake_n;
        sum.add(&scan.run_tuple(index, |run, i| {
            (control_n(late[i]) - control_n(reported[i])) / run.samples()[i].inertial_mass_kg
        }));
    }
    scan.decrease_at_one(&sum)
}

/// Traction and brake force in N.
type Forces = [f64; 2];

/// The forces `delay_s` earlier, then lagged by `lag_s`: exact for forces linear between samples.
fn delayed(time_s: &[f64], forces_n: &[Forces], delay_s: f64, lag_s: f64) -> Vec<Forces> {
    let both = |value: &dyn Fn(usize) -> f64| [value(0), value(1)];
    let mut before = 0;
    let mut last: Option<(f64, Forces)> = None;
    let mut by_step = Fade::new(lag_s);
    let mut lagged = [0.0; 2];
    (0..time_s.len())
        .map(|i| {
            let at_s = time_s[i] - delay_s;
            while before + 1 < time_s.len() && time_s[before + 1] <= at_s {
                before += 1;
            }
            let input = if at_s <= time_s[0] || before + 1 >= time_s.len() {
                forces_n[before]
            } else {
                let share = (at_s - time_s[before]) / (time_s[before + 1] - time_s[before]);
                let (from, to) = (forces_n[before], forces_n[before + 1]);
                both(&|k| from[k] + share * (to[k] - from[k]))
            };
            lagged = match last {
                Some((last_s, last_input)) if lag_s > 1e-3 => {
                    let step_s = time_s[i] - last_s;
                    let fade = by_step.over(step_s);
                    // Response to a ramp from the last input to this one.
                    let ramp = 1.0 - lag_s * (1.0 - fade) / step_s;
                    both(&|k| {
                        fade * lagged[k]
                            + (1.0 - fade) * last_input[k]
                            + ramp * (input[k] - last_input[k])
                    })
                }
                _ => input,
            };
            last = Some((time_s[i], input));
            lagged
        })
        .collect()
}

impl Hypothesis for DelayAndLag {
    fn kind(&self) -> EffectKind {
        EffectKind::ActuatorDelay
    }

    fn parameters(&self) -> &[Parameter] {
        &PARAMETERS
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0] + parameters[1] > 0.15
    }

    fn apply(&self, parameters: &[f64], run: &RunData, forces: &mut [SampleForces]) {
        let time_s = run.recording.time_s();
        let [delay_s, lag_s] = [parameters[0], parameters[1]];
        let reported: Vec<Forces> =
            forces.iter().map(|force| [force.traction_n, force.brake_n]).collect();
        let late = delayed(time_s, &reported, delay_s, lag_s);
        for (force, [traction_n, brake_n]) in forces.iter_mut().zip(late) {
            (force.traction_n, force.brake_n) = (traction_n, brake_n);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_comes_late_and_with_a_lag() {
        let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let height = |t: f64| if t < 2.0 { 0.0 } else { 100.0 };
        let step: Vec<Forces> = time_s.iter().map(|&t| [height(t), 0.5 * height(t)]).collect();
        let late = delayed(&time_s, &step, 1.5, 0.8);
        for (time, force) in time_s.iter().zip(late) {
            let expected = 100.0 * (1.0 - (-(time - 3.5f64).max(0.0) / 0.8).exp());
            for (force, expected) in force.into_iter().zip([expected, 0.5 * expected]) {
                assert!((force - expected).abs() < 1.0, "{time}: {force} {expected}");
            }
        }
    }

    #[test]
    fn no_delay_changes_nothing() {
        let (time_s, force) = (vec![0.0, 0.3, 0.9], vec![[3.0, 0.0], [-1.0, 2.0], [8.0, 1.0]]);
        assert_eq!(delayed(&time_s, &force, 0.0, 0.0), force);
    }
}
