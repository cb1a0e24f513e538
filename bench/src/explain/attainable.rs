//! Best attainable result of any search: the true law, whose numbers are estimated together with a, b, c from the same
//! runs.

use std::sync::Arc;

use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::effects::{Hypothesis, Nature, On};
use dynocar_analysis::explain::evidence::{Noise, SampleForces, UpdatedModel};
use dynocar_analysis::explain::score::run_error;
use dynocar_model::simulate::{Restart, SpeedError};
use dynocar_model::terms::Parameter;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::{Around, Law, SimulatedDataset, TrueEffect, Unlisted};

/// Half the difference of the speeds in m/s between which the slope of a law is taken.
const SLOPE_OVER_MPS: f64 = 0.01;

/// A law of the simulator whose numbers are estimated.
#[derive(Debug)]
struct TrueLaw {
    law: Law,
    parameters: Vec<Parameter>,
}

/// Returns the numbers of a law besides its size; a number that only scales another does not count.
fn numbers_of(law: &mut Law) -> Vec<&mut f64> {
    match law {
        Law::Band { centre_mps, width_mps } => vec![centre_mps, width_mps],
        Law::Slow { below_mps, least_mps } => vec![below_mps, least_mps],
        Law::Power { exponent, .. } => vec![exponent],
        Law::Beyond { from_mps, .. } => vec![from_mps],
        Law::Levelling { over_mps } => vec![over_mps],
        Law::FastInCold { until_degc, .. } => vec![until_degc],
        Law::FastLater { from_s, .. } => vec![from_s],
    }
}

fn numbers(mut law: Law) -> Vec<f64> {
    numbers_of(&mut law).into_iter().map(|number| *number).collect()
}

/// Returns the law with other numbers.
fn with_numbers(mut law: Law, numbers: &[f64]) -> Law {
    numbers_of(&mut law).into_iter().zip(numbers).for_each(|(own, number)| *own = *number);
    law
}

impl TrueLaw {
    fn new(law: Law) -> Self {
        let size = Parameter::new("n_per_kn", (-100.0, 100.0), 0.01);
        let of = |value: f64| Parameter::new("number", (0.3 * value, 3.0 * value), 0.01 * value);
        // A temperature may have either sign.
        let degc = |value: f64| Parameter::new("degc", (value - 30.0, value + 30.0), 0.1);
        let is_cold = matches!(law, Law::FastInCold { .. });
        let others = numbers(law).into_iter().map(|it| if is_cold { degc(it) } else { of(it) });
        TrueLaw { law, parameters: std::iter::once(size).chain(others).collect() }
    }
}

impl Hypothesis for TrueLaw {
    fn nature(&self) -> Nature<'_> {
        Nature::new(EffectKind::Unknown, &self.parameters)
    }

    fn apply(&self, parameters: &[f64], On { run, first, .. }: On, forces: &mut [SampleForces]) {
        let law = with_numbers(self.law, &parameters[1..]);
        let unlisted = Unlisted { law, n_per_kn: parameters[0] };
        let samples = run.samples()[first..].iter().zip(&run.recording.time_s()[first..]);
        for ((sample, &time_s), force) in samples.zip(forces) {
            let degc = sample.ambient_temperature_degc.unwrap_or(0.0);
            let at = |speed_mps: f64| {
                unlisted.resistance_n_per_kn(Around { speed_mps: speed_mps.max(0.0), time_s, degc })
            };
            let speed_mps = sample.speed_mps;
            let change = at(speed_mps + SLOPE_OVER_MPS) - at(speed_mps - SLOPE_OVER_MPS);
            let slope = change / (2.0 * SLOPE_OVER_MPS);
            force.resistance.other_n_per_kn += at(speed_mps) - slope * speed_mps;
            force.resistance.other_per_mps += slope;
        }
    }
}

/// Returns the error in m/s on the holdout runs that the true law leaves when its numbers and a, b, c are
/// fitted to the fit runs, from the truth on and by the very fit that `explain` uses; `None` where
/// no law of the simulator's own acts.
pub fn attainable_mps(simulated: &SimulatedDataset, explanation: &Explanation) -> Option<f64> {
    let unlisted = simulated.effects.iter().find_map(|effect| match effect {
        TrueEffect::Unlisted(unlisted) => Some(*unlisted),
        _ => None,
    })?;
    let davis = simulated.train.resistance;
    let mut start = vec![davis.a, davis.b, davis.c, unlisted.n_per_kn];
    start.extend(numbers(unlisted.law));
    let model = UpdatedModel::default().with(Arc::new(TrueLaw::new(unlisted.law)));
    let problem = &explanation.problem;
    let first = problem.fit_with_noise(&model, start, Noise::START);
    let fit = problem.fit_with_noise(&model, first.theta, first.noise);
    let errors = explanation.holdout.iter().map(|run| run_error(&fit, run, Restart::FullRun));
    errors.sum::<SpeedError>().rmse_mps()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_put_back_where_they_came_from() {
        let laws = [
            Law::Band { centre_mps: 12.0, width_mps: 1.0 },
            Law::Slow { below_mps: 15.0, least_mps: 3.0 },
            Law::Power { at_mps: 40.0, exponent: 3.3 },
            Law::Beyond { from_mps: 9.0, span_mps: 7.0 },
            Law::Levelling { over_mps: 6.0 },
            Law::FastInCold { at_mps: 20.0, until_degc: -3.0 },
            Law::FastLater { at_mps: 20.0, from_s: 300.0 },
        ];
        for law in laws {
            assert_eq!(with_numbers(law, &numbers(law)), law);
            let parameters = TrueLaw::new(law).parameters;
            for (own, spec) in numbers(law).iter().zip(&parameters[1..]) {
                assert!(spec.lower < *own && *own < spec.upper, "{law:?}: {own} in {spec:?}");
            }
        }
    }
}
