//! A measured speed that is late. The gradient acts in time where only the forces are late, but seems late where the
//! speed is: this distinguishes the two, and so does a position that is ahead of the speed.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::speed_delay;
use dynocar_model::train::Davis;
use dynocar_shared::vocabulary::EffectKind;

use super::lateness::{late_by_sampling_s, late_from, late_reported};
use super::{
    Candidate, Certainty, Everyday, Hypothesis, Nature, On, OnOthers, Policy, Proposal,
    ReportContext, ReportedValues, Turn,
};
use crate::explain::evidence::SampleForces;
use crate::explain::scan::Scan;

/// Delays and lags in s from which a fit may start.
const STARTS: [[f64; 2]; 4] = [[0.6, 0.1], [0.1, 0.6], [1.2, 0.3], [0.3, 1.2]];

#[derive(Debug)]
struct DelayAndLag;

/// Late forces look like a late speed, so it is never certain.
pub const POLICY: Policy = Policy {
    certainty: Certainty::Never,
    is_sought_with_nuisance: false,
    everyday: Some(Everyday { rank: 4, most: f64::INFINITY }),
    is_late: true,
    ..Policy::USUAL
};

/// Proposes structures for the data at hand.
pub fn propose(scan: &Scan) -> Proposal {
    if !scan.problem.runs.iter().any(|run| run.is_position_recorded) {
        return Err(
            "positions are integrated from the speed and late with it, so that forces that act \
             late look the same"
                .into(),
        );
    }
    let start = late_from(&STARTS, |start| decrease(scan, start));
    Ok(vec![Candidate::new(DelayAndLag, start)])
}

/// Decrease of the cost when the speed is late by this delay and lag.
fn decrease(scan: &Scan, start: [f64; 2]) -> f64 {
    let theta = &scan.fit.theta;
    let davis = Davis { a: theta[0], b: theta[1], c: theta[2] };
    scan.decrease_by(&DelayAndLag, &start, |run, i, [declared, late]| {
        let speed_mps = run.smooth_mps[i];
        let mps2 = |force: &SampleForces| {
            let [p0, p1, p2] = force.polynomial(davis, speed_mps);
            p0 + speed_mps * (p1 + speed_mps * p2)
        };
        mps2(late) - mps2(declared)
    })
}

impl Hypothesis for DelayAndLag {
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
