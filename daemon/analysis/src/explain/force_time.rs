//! Time of the recorded forces. A recorder that averages over the second before its time stamp, or stamps late, holds
//! forces that act before their stamps; in recordings with one sample per second this costs as much error as all other
//! causes together. The lateness is estimated before the search for undeclared effects. A force that acts after its
//! stamp is an actuator's delay, for which the search looks.

use std::sync::Arc;

use dynocar_model::terms::Parameter;

use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;

use super::answer::WithStd;
use super::effects::{Hypothesis, Nature, On};
use super::evidence::{FitProblem, SampleForces, UpdatedModel};
use super::selection::{OBSERVATIONS_MIN, deviations};
use crate::dataset::{is_stamped_late, stamped_late};

/// Where the samples are nearer in time than this in s, a late stamp is left to each run's own small delay.
const STEP_MIN_S: f64 = 0.5;
/// A lateness below this share of the step between samples is left to it as well.
const LATE_SHARE_MIN: f64 = 0.1;

const PARAMETERS: [Parameter; 1] = [Parameter::new("force_late_s", (-1.0, 1.0), 0.02)];

/// Forces that act before their stamps (after them, where negative), along straight lines between
/// the samples.
#[derive(Debug)]
struct LateStamps;

impl Hypothesis for LateStamps {
    fn nature(&self) -> Nature<'_> {
        Nature::new(EffectKind::ActuatorDelay, &PARAMETERS)
    }

    /// No other effect acts before this one: the forces around a sample are the declared ones.
    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let (late_s, time_s) = (parameters[0], run.recording.time_s());
        for (i, force) in (first..).zip(forces) {
            let other = if late_s >= 0.0 { i + 1 } else { i.wrapping_sub(1) };
            let Some(ahead) = run.declared.get(other) else { continue };
            let step_s = (time_s[other] - time_s[i]).abs();
            let at = |own, ahead| stamped_late(own, ahead, step_s, late_s.abs());
            force.traction_n = at(force.traction_n, ahead.traction_n);
            force.brake_n = at(force.brake_n, ahead.brake_n);
        }
    }
}

/// Returns whether samples `step_s` apart leave the time of the forces open.
pub fn is_sought(step_s: f64) -> bool {
    step_s >= STEP_MIN_S
}

/// Returns by how many s runs with samples `step_s` apart stamp forces late; `None` where the forces act after their
/// stamps, or where it is not identifiable.
pub fn estimated(problem: &FitProblem, step_s: f64) -> Option<WithStd> {
    let model = UpdatedModel::default().with(Arc::new(LateStamps));
    let fit = problem.fit_from_declared(&model, &[0.0]);
    if fit.observations() < OBSERVATIONS_MIN {
        return None;
    }
    let deviation = deviations(&fit).std;
    let late = WithStd { value: fit.effect_parameters(0)[0], std: deviation[3] };
    let is_inside = LateStamps.at_bound(&[late.value]).is_none();
    let counts = late.value > LATE_SHARE_MIN * step_s && is_inside;
    (counts && is_stamped_late(late.value, late.std)).then_some(late)
}

/// Returns the estimate as a sentence to follow another.
pub fn sentence(late: WithStd) -> String {
    format!(
        " Forces act {:.2} ± {:.2} s before their stamps and were taken where they act.",
        late.value,
        HALF_95 * late.std
    )
}
