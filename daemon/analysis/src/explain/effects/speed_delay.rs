//! A measured speed that is late. Forces that act late leave the gradient on time, a late speed does
//! not: what the line does distinguishes the two, and so does a position that runs ahead of the speed.

use dynocar_model::terms::extra::Covariate;
use dynocar_model::terms::speed_delay;
use dynocar_model::terms::{Entry, Parameter};
use dynocar_model::train::Davis;
use dynocar_shared::vocabulary::EffectKind;

use super::proposal::{late_by_sampling_s, late_from, late_reported};
use super::{
    Candidate, Effect, Hypothesis, OnOthers, Past, Proposal, ReportContext, Reported, Turn,
};
use crate::explain::evidence::{RunData, SampleForces};
use crate::explain::scan::Scan;

/// Delay and lag in s that a fit may start from.
const STARTS: [[f64; 2]; 4] = [[0.6, 0.1], [0.1, 0.6], [1.2, 0.3], [0.3, 1.2]];

/// The kind.
pub struct SpeedDelay;

#[derive(Debug)]
struct DelayAndLag;

impl Effect for SpeedDelay {
    fn kind(&self) -> EffectKind {
        EffectKind::SpeedDelay
    }

    fn propose(&self, scan: &Scan) -> Proposal {
        if !scan.problem.runs.iter().any(|run| run.is_position_recorded) {
            return Proposal::NotTestable(
                "positions are integrated from the speed and late with it, so that forces that act \
                 late look the same"
                    .into(),
            );
        }
        let start = late_from(&STARTS, |start| decrease(scan, start));
        Proposal::Candidates(vec![Candidate::new(DelayAndLag, start)])
    }
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
    fn kind(&self) -> EffectKind {
        EffectKind::SpeedDelay
    }

    fn parameters(&self) -> &[Parameter] {
        &speed_delay::PARAMETERS
    }

    fn sampling_error(&self, step_s: f64) -> f64 {
        late_by_sampling_s(step_s)
    }

    fn is_material(&self, parameters: &[f64], _c: f64) -> bool {
        parameters[0] + parameters[1] > speed_delay::LEAST_S
    }

    fn on_others(&self) -> OnOthers {
        OnOthers::Changes
    }

    fn apply(&self, parameters: &[f64], run: &RunData, first: usize, forces: &mut [SampleForces]) {
        self.apply_after(&mut Past::default(), parameters, run, first, forces);
    }

    fn looks_back(&self) -> bool {
        true
    }

    fn apply_after(
        &self,
        past: &mut Past,
        parameters: &[f64],
        run: &RunData,
        first: usize,
        forces: &mut [SampleForces],
    ) {
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

    fn report(&self, context: &ReportContext) -> Reported {
        late_reported(context, self.parameters())
    }

    fn speed_late_s(&self, parameters: &[f64]) -> Option<f64> {
        Some(parameters.iter().sum())
    }

    fn turn(&self) -> Turn {
        Turn::Last
    }

    fn entries(&self, parameters: &[f64]) -> Option<Vec<Entry>> {
        Some(vec![
            Entry::Number(&speed_delay::DELAY, parameters[0]),
            Entry::Number(&speed_delay::LAG, parameters[1]),
        ])
    }
}
