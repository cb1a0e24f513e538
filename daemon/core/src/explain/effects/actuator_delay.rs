//! Forces that act later than reported: a dead time, then a first-order lag.

use dynocar_shared::vocabulary::EffectKind;

use super::{Candidate, Effect, Hypothesis, Parameter, Proposal};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

const PARAMETERS: [Parameter; 2] =
    [Parameter::new("delay_s", (0.0, 6.0), 0.05), Parameter::new("lag_s", (0.0, 8.0), 0.05)];

/// The kind.
pub struct ActuatorDelay;

#[derive(Debug)]
struct DelayAndLag;

impl Effect for ActuatorDelay {
    fn kind(&self) -> EffectKind {
        EffectKind::ActuatorDelay
    }

    fn propose(&self, _scan: &Scan) -> Proposal {
        let starts = [[0.3, 0.3], [1.0, 1.0], [0.2, 2.0]];
        Proposal::Candidates(
            starts.map(|start| Candidate::new(DelayAndLag, start.to_vec())).to_vec(),
        )
    }
}

/// The force `delay_s` earlier, then lagged by `lag_s`: exact for forces linear between samples.
fn delayed(time_s: &[f64], force_n: &[f64], delay_s: f64, lag_s: f64) -> Vec<f64> {
    let mut before = 0;
    let mut last: Option<(f64, f64)> = None;
    let mut lagged = 0.0;
    (0..time_s.len())
        .map(|i| {
            let at_s = time_s[i] - delay_s;
            while before + 1 < time_s.len() && time_s[before + 1] <= at_s {
                before += 1;
            }
            let input = if at_s <= time_s[0] || before + 1 >= time_s.len() {
                force_n[before]
            } else {
                let share = (at_s - time_s[before]) / (time_s[before + 1] - time_s[before]);
                force_n[before] + share * (force_n[before + 1] - force_n[before])
            };
            lagged = match last {
                Some((last_s, last_input)) if lag_s > 1e-3 => {
                    let step_s = time_s[i] - last_s;
                    let fade = (-step_s / lag_s).exp();
                    // Response to a ramp from the last input to this one.
                    let slope = (input - last_input) / step_s;
                    fade * lagged
                        + (1.0 - fade) * last_input
                        + slope * (step_s - lag_s * (1.0 - fade))
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
        let traction: Vec<f64> = forces.iter().map(|force| force.traction_n).collect();
        let brake: Vec<f64> = forces.iter().map(|force| force.brake_n).collect();
        let traction = delayed(time_s, &traction, delay_s, lag_s);
        let brake = delayed(time_s, &brake, delay_s, lag_s);
        for (force, (traction_n, brake_n)) in forces.iter_mut().zip(traction.into_iter().zip(brake))
        {
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
        let step: Vec<f64> = time_s.iter().map(|&t| if t < 2.0 { 0.0 } else { 100.0 }).collect();
        let late = delayed(&time_s, &step, 1.5, 0.8);
        for (time, force) in time_s.iter().zip(late) {
            let expected = 100.0 * (1.0 - (-(time - 3.5f64).max(0.0) / 0.8).exp());
            assert!((force - expected).abs() < 1.0, "{time}: {force} {expected}");
        }
    }

    #[test]
    fn no_delay_changes_nothing() {
        let (time_s, force) = (vec![0.0, 0.3, 0.9], vec![3.0, -1.0, 8.0]);
        assert_eq!(delayed(&time_s, &force, 0.0, 0.0), force);
    }
}
