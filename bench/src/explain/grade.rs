//! An answer against the truth, and against the best attainable result of any search: the true law, whose numbers are
//! estimated together with a, b, c from the same runs.

use std::sync::Arc;

use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::ExplainAnswer;
use dynocar_analysis::explain::effects::{Hypothesis, Nature, On};
use dynocar_analysis::explain::evidence::{Noise, SampleForces, UpdatedModel};
use dynocar_analysis::explain::score::run_error;
use dynocar_analysis::explain::selection::Search;
use dynocar_model::simulate::{Restart, SpeedError};
use dynocar_model::terms::Parameter;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::oracle::score;
use dynocar_tests::simulator::{Around, Law, SimulatedDataset, TrueEffect, Unlisted};
use serde_json::Value;

use super::parameters::{ParameterGrade, ends_within, graded, place_iou};
use super::scenario::SimulatedCase;

/// How good an answer is.
#[derive(Clone, Debug, PartialEq)]
pub struct Grade {
    /// The kinds that the answer names, strongest first; empty for none.
    pub named: Vec<String>,
    /// The verdict in a word.
    pub verdict: String,
    /// True when verdict and kinds are right; where everything is a little wrong, small things that
    /// are in the world may be named too.
    pub is_right: bool,
    /// Intersection over union of the places, where the effect has one.
    pub iou: Option<f64>,
    /// For every end of a place with a 95 % interval, whether that holds the true end.
    pub ends_held: Vec<bool>,
    /// Relative errors of the parameters and whether their 95 % intervals hold the truth.
    pub parameters: Vec<ParameterGrade>,
    /// The same for the estimates from the held-out runs alone.
    pub held_out: Vec<ParameterGrade>,
    /// The same for a, b and c.
    pub davis: Vec<ParameterGrade>,
    /// For every effect, the p-value of its size in the held-out runs if it is the same as in the fitted runs.
    pub held_out_chances: Vec<f64>,
    /// Evidence, error reduction and parameters of the named effects, for people.
    pub details: Vec<String>,
    /// The answer against the true model; `None` where nothing acts or nothing moves.
    pub attained: Option<Attained>,
    /// Greatest acceptance score of a candidate in the first round of the search.
    pub acceptance_score: f64,
}

/// Grades the explanation of a case.
pub fn grade(
    simulated: &SimulatedDataset,
    case: &SimulatedCase,
    explanation: &Explanation,
) -> Grade {
    let answer = &explanation.answer;
    let named: Vec<String> = answer.effects.iter().map(|effect| effect.kind.into()).collect();
    let verdict = answer.verdict.name();
    let truth: Vec<&str> = simulated.effects.iter().map(|effect| effect.kind().name()).collect();
    let mut found: Vec<&str> = named.iter().map(String::as_str).collect();
    found.extend(&answer.ambiguous_with);
    let everyday: Vec<&str> = case.world.everyday().iter().map(|kind| kind.name()).collect();
    let competing = case.scenario.competing();
    let is_invented = |kind: &&str| {
        let is_competing = competing.is_some_and(|(competing, _)| competing.name() == *kind);
        !truth.contains(kind) && !everyday.contains(kind) && !is_competing
    };
    let is_right = if everyday.is_empty() {
        is_exactly(simulated, competing, verdict, &found)
    } else {
        let is_found = truth.iter().all(|kind| found.contains(kind));
        let is_known = verdict != "unknown" || truth.contains(&"unknown");
        is_found && is_known && !found.iter().any(is_invented)
    };
    let attained = attained(simulated, explanation);
    let json = serde_json::to_value(answer).unwrap_or(Value::Null);
    let details = details(simulated, answer, attained);
    let (mut iou, mut ends_held, mut parameters) = (None, Vec::new(), Vec::new());
    let (mut held_out, mut held_out_chances) = (Vec::new(), Vec::new());
    for effect in &simulated.effects {
        let own = json["effects"].as_array().into_iter().flatten();
        let own = own.clone().find(|answer| answer["kind"] == effect.kind().name());
        if let Some(own) = own {
            iou = place_iou(effect, own, simulated).or(iou);
            ends_held.extend(ends_within(effect, own));
            parameters.extend(graded(effect, own, simulated, Role::Fit));
            held_out.extend(graded(effect, &own["held_out"], simulated, Role::Holdout));
            held_out_chances.extend(own["held_out"]["p_value"].as_f64());
        }
    }
    let (base, truth) = (&answer.base, simulated.train.resistance);
    let davis = [
        ("a", base.a, base.std.a, truth.a),
        ("b", base.b, base.std.b, truth.b),
        ("c", base.c, base.std.c, truth.c),
    ];
    let davis = davis.map(|(name, value, std, truth)| ParameterGrade {
        name: name.into(),
        error: value / truth - 1.0,
        z: (value - truth) / std,
    });
    // A force without a name shares its mean with them.
    let is_comparable = simulated.verdict() != "unknown";
    let davis = davis.into_iter().filter(|_| is_comparable).collect();
    Grade {
        davis,
        details,
        named,
        verdict: verdict.into(),
        is_right,
        iou,
        ends_held,
        parameters,
        held_out,
        held_out_chances,
        attained,
        acceptance_score: Search::greatest_score(&explanation.outcome),
    }
}

/// Returns whether the answer names the effects that act, and no others.
fn is_exactly(
    simulated: &SimulatedDataset,
    competing: Option<(EffectKind, bool)>,
    verdict: &str,
    found: &[&str],
) -> bool {
    let mut expected: Vec<&str> =
        simulated.effects.iter().map(|effect| effect.kind().name()).collect();
    if let Some((kind, is_never_named)) = competing
        && (is_never_named || verdict == "ambiguous")
    {
        expected.push(kind.name());
    }
    let mut found = found.to_vec();
    expected.sort_unstable();
    found.sort_unstable();
    let right =
        if expected.len() > simulated.effects.len() { "ambiguous" } else { simulated.verdict() };
    verdict == right && (right == "unknown" || expected == found)
}

/// Describes the answer for people, and the true form if it is in no library.
fn details(
    simulated: &SimulatedDataset,
    answer: &ExplainAnswer,
    attained: Option<Attained>,
) -> Vec<String> {
    let mut details: Vec<String> = answer
        .effects
        .iter()
        .map(|effect| {
            let parameters = serde_json::to_string(&effect.parameters).unwrap_or_default();
            let others = effect.runners_up.iter();
            let others: Vec<String> = others
                .map(|other| format!("[{} -{:.0}]", other.formula, other.evidence_less))
                .collect();
            format!(
                "{} -{:.3} p {:.1e} {parameters} {}",
                effect.kind,
                effect.error_reduction,
                effect.p_value,
                others.join(" ")
            )
        })
        .collect();
    details.push(format!(
        "holdout {:.3?} to {:.3?} m/s, {:.2?} of the true model's ({:.2?} attainable), unexplained {:.3?} N/kN",
        answer.rmse_before,
        answer.rmse_after,
        attained.map(|attained| attained.left_ratio),
        attained.and_then(|attained| attained.attainable_ratio),
        answer.unexplained_n_per_kn
    ));
    let unlisted = simulated.effects.iter().filter(|it| matches!(it, TrueEffect::Unlisted(_)));
    details.extend(unlisted.map(|effect| format!("truth {effect:?}")));
    let considered = answer.considered.iter().enumerate();
    let considered = considered.filter(|(k, it)| *k < 4 || it.kind == "unknown").map(|it| it.1);
    details.extend(considered.map(|it| format!("{} {:.0?}: {}", it.kind, it.evidence, it.reason)));
    if !answer.ambiguous_with.is_empty() {
        details.push(format!("or {}", answer.ambiguous_with.join(", ")));
    }
    details
}

/// An answer against the true model, on the holdout runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attained {
    /// Share of the attainable reduction of the error; `None` where the true model takes less than a sixth of it.
    pub share: Option<f64>,
    /// Error over that of the true model.
    pub left_ratio: f64,
    /// The same of the true law with estimated numbers, for a law that no library holds.
    pub attainable_ratio: Option<f64>,
}

fn attained(simulated: &SimulatedDataset, explanation: &Explanation) -> Option<Attained> {
    if simulated.effects.is_empty() {
        return None;
    }
    // A train too weak for its line stays where it is, and there is nothing to predict.
    let holdout = simulated.runs.iter().filter(|run| run.plan.is_holdout);
    let moving = holdout.flat_map(|run| &run.samples).filter(|sample| sample.speed_mps > 0.5);
    if moving.count() == 0 {
        return None;
    }
    let oracle = score(simulated).full_run.true_mps;
    let (before, after) = (explanation.answer.rmse_before?, explanation.answer.rmse_after?);
    let share = (before - after) / (before - oracle);
    let share = (before > 1.2 * oracle).then_some(share);
    let attainable_ratio = attainable_mps(simulated, explanation).map(|left| left / oracle);
    (oracle > 0.0).then(|| Attained { share, left_ratio: after / oracle, attainable_ratio })
}

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
