//! An answer against the truth.

use dynocar_analysis::dataset::Role;
use dynocar_analysis::explain::Explanation;
use dynocar_analysis::explain::answer::ExplainAnswer;
use dynocar_analysis::explain::selection::Search;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::oracle::score;
use dynocar_tests::simulator::{SimulatedDataset, TrueEffect};
use serde_json::Value;

use super::attainable::attainable_mps;
use super::family::SimulatedCase;
use super::parameters::{ParameterGrade, ends_within, graded, place_iou};

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
    Grade {
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
