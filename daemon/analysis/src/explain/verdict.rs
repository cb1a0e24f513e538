//! The answer to a finished search.

use std::collections::BTreeMap;
use std::ops::Range;

use dynocar_core::plausibility::Severity;
use dynocar_model::simulate::SpeedError;
use dynocar_shared::vocabulary::EffectKind;

use super::answer::{
    BaseAnswer, Considered, DavisDeviations, EffectAnswer, EffectMeaning, ExplainAnswer,
    HeldOutAnswer, Location, Verdict, VerdictWords,
};
use super::caveats::{FinishedFit, caveats, identifiability, told_by_data, trimmed};
use super::competing::{
    CompetingHypotheses, competing_hypotheses, kinds_of, runners_up, separating_run,
};
use super::effects::ReportContext;
use super::evidence::p_value;
use super::held_out::HeldOutEffect;
use super::hypothesis::{Hypothesis, ReportedValues};
use super::report::effect::{changing, contradicting_scales, located, small, verdict_words};
use super::score::{self, PredictionScore};
use super::selection::{
    Deviations, ScaleSources, Search, SearchOutcome, deciding_score, discounted, few_runs_factor,
    penalty,
};
use super::unexplained::Unexplained;
use crate::dataset::DatasetDiagnostic;
use crate::statistics::greatest_first;

/// Moving time in s of the fit runs below which nothing is said.
const MOVING_MIN_S: f64 = 180.0;
/// Share of the decrease that the library must explain when something unknown is left too.
const LIBRARY_SHARE_MIN: f64 = 0.5;

/// Returns the answer to a finished search.
pub fn answer(
    search: &Search,
    outcome: &SearchOutcome,
    known: &FinishedFit,
    score: &PredictionScore,
    diagnostics: Vec<DatasetDiagnostic>,
) -> ExplainAnswer {
    let (fit, std) = (&outcome.fit, &known.deviations.std);
    // The coefficients of the updated model predict best without the usual errors, and make up for these.
    let joint = outcome.nuisance_fit();
    let davis = &joint.as_ref().map_or(fit, |joint| &joint.fit).theta;
    let mut effects = effect_answers(search, outcome, known);
    // An effect without a name has no competing hypotheses either.
    let is_unknown = fit.model.has(EffectKind::Unknown);
    let competing = if is_unknown { Vec::new() } else { competing_hypotheses(search, outcome) };
    let left = Unexplained::new(search, outcome);
    let verdict = verdict(search, outcome, &competing, left.as_ref());
    if let Some(words) = left.as_ref().and_then(|left| left.contradiction(&diagnostics)) {
        for effect in &mut effects {
            effect.contradiction.get_or_insert_with(|| words.into());
        }
    }
    let is_enough = verdict != Verdict::InsufficientData;
    let identifiability = if is_enough { identifiability(search, outcome) } else { Vec::new() };
    let [rmse_before, rmse_after] = score.holdout_rmse_mps();
    let pair = |errors: [SpeedError; 2]| Some([errors[0].rmse_mps()?, errors[1].rmse_mps()?]);
    let left = left.as_ref();
    let words = impossible(&diagnostics);
    let is_told = words.is_none() && is_enough;
    let (words, experiment) = words
        .unwrap_or_else(|| worded(search, outcome, verdict, &effects, &competing, left, known));
    let caveats = match is_told {
        true => caveats(search, outcome, &effects, known, score, &identifiability),
        false => Vec::new(),
    };
    ExplainAnswer {
        verdict,
        statement: [&words.whole, &words.left].map(String::as_str).concat() + &caveats.concat(),
        words,
        caveats: trimmed(&caveats),
        diagnostics,
        over_time: if is_told { known.unnamed_courses(&effects) } else { BTreeMap::new() },
        effects,
        ambiguous_with: kinds_of(&competing),
        experiment,
        base: BaseAnswer {
            a: davis[0],
            b: davis[1],
            c: davis[2],
            std: DavisDeviations { a: std[0], b: std[1], c: std[2] },
            told_by_data: told_by_data(search.problem, std),
        },
        metric: "full_run",
        scored_runs: score.holdout_runs.iter().filter(|run| run[0].count > 0).count(),
        unscored: unscored(search, score),
        judged: score.judged(),
        rmse_before,
        rmse_after,
        error_reduction_interval: score.reduction_interval(),
        window60: pair(score.holdout_window60),
        stop_to_stop: score.holdout_stop_to_stop.clone(),
        fit_runs: pair(score.fit_runs),
        drive: None,
        force_late_s: None,
        unexplained_n_per_kn: left.map(|left| left.n_per_kn),
        considered: considered(outcome, &competing),
        identifiability,
        predictions: BTreeMap::new(),
    }
}

/// The verdict in words, and the recommended action.
type Words = (VerdictWords, Option<String>);

/// Returns the words where the data cannot be true.
fn impossible(diagnostics: &[DatasetDiagnostic]) -> Option<Words> {
    let fundamental = diagnostics.iter().filter(|it| it.severity == Severity::Fundamental);
    let faults: Vec<String> = fundamental.map(ToString::to_string).collect();
    let words = || format!("The data cannot be true as described: {}", faults.join("; "));
    let to_do = "Set right what is named and run this again.";
    (!faults.is_empty()).then(|| (VerdictWords::from_text(words()), Some(to_do.into())))
}

/// Returns why nothing was scored, with the errors on the fit runs; `None` when the holdout runs were scored.
fn unscored(search: &Search, score: &PredictionScore) -> Option<String> {
    if score.holdout_rmse_mps()[0].is_some() {
        return None;
    }
    let why = match search.holdout {
        [] => "No run is held out (role = \"holdout\")",
        _ => "The runs held out hold no motion",
    };
    let [before, after] = score.fit_runs.map(|error| error.rmse_mps());
    let figure = match (before, after) {
        (Some(before), Some(after)) => format!(
            ": the open-loop error on the fit runs, {before:.3} m/s before and {after:.3} m/s \
             after, is of runs that the model was fitted to, and says nothing of others"
        ),
        _ => String::new(),
    };
    Some(format!("{why}, so that nothing was scored{figure}."))
}

/// Returns the time in s of usable motion in the fit runs.
fn moving_s(search: &Search) -> f64 {
    // A sum of nothing would be -0.
    search.problem.runs.iter().fold(0.0, |sum, run| sum + run.moving_s())
}

fn effect_answers(
    search: &Search,
    outcome: &SearchOutcome,
    known: &FinishedFit,
) -> Vec<EffectAnswer> {
    let Deviations { std, covariance, c } = known.deviations;
    let fit = &outcome.fit;
    let apart = ScaleSources::of(search.problem, outcome).filter(ScaleSources::are_apart);
    let mut answers: Vec<(f64, EffectAnswer)> = fit
        .model
        .effects
        .iter()
        .zip(fit.model.ranges())
        .enumerate()
        .filter(|(_, (effect, _))| outcome.is_named(effect.kind()))
        .map(|(index, (effect, range))| {
            let likeliest = &outcome.likeliest;
            let rest = search.without(likeliest, index);
            let decrease = discounted(likeliest, index, rest.cost - likeliest.cost);
            let reduction = score::reduction(search.problem, &rest, likeliest);
            let evidence = decrease - penalty(likeliest, index);
            let is_certain = outcome.is_certain(effect.kind());
            let score = deciding_score(likeliest, index, (evidence, reduction), is_certain);
            let weights = search.problem.runs.iter().filter_map(|run| run.samples().first());
            let weight_kn = weights.map(|sample| sample.weight_kn).sum::<f64>()
                / search.problem.runs.len().max(1) as f64;
            let stated = ReportContext {
                parameters: &fit.theta[range.clone()],
                deviations: &std[range.clone()],
                c: *c,
                c_deviation: std[2],
                covariance,
                first: range.start,
                weight_kn,
                few_runs_factor: few_runs_factor(search.problem.runs.len()),
            };
            let reported = effect.report(&stated);
            let held_out = known.held_out[index].as_ref();
            let held_out = held_out.map(|it| held_out_answer(&**effect, it, range.clone(), stated));
            let answer = EffectAnswer {
                kind: effect.kind().name(),
                place: Location { uncertainty_95: known.places[index].clone(), ..effect.place() },
                parameters: reported.values,
                std: reported.deviations,
                p_value: p_value(score),
                error_reduction: reduction,
                meaning: EffectMeaning::new(search.problem, fit, index, &rest),
                contradiction: apart
                    .filter(|_| effect.nature().changes_speed_scale)
                    .map(|sources| contradicting_scales(&sources)),
                over_time: known.courses(effect.kind()),
                held_out,
                runners_up: if effect.kind() == EffectKind::Unknown {
                    runners_up(search, outcome)
                } else {
                    Vec::new()
                },
            };
            (decrease, answer)
        })
        .collect();
    greatest_first(&mut answers, |it| it.0);
    answers.into_iter().map(|(_, answer)| answer).collect()
}

/// Returns the numbers of an effect by the runs held out, in the form of those of the fit runs, which are stated in a
/// context.
fn held_out_answer(
    effect: &dyn Hypothesis,
    held_out: &HeldOutEffect,
    range: Range<usize>,
    stated: ReportContext,
) -> HeldOutAnswer {
    let Deviations { std, covariance, c } = &held_out.deviations;
    let ReportedValues { values, deviations } = effect.report(&ReportContext {
        parameters: &held_out.theta[range.clone()],
        deviations: &std[range],
        c: *c,
        c_deviation: std[2],
        covariance,
        ..stated
    });
    let (runs, p_value) = (held_out.runs, held_out.p_value);
    HeldOutAnswer { runs, parameters: values, std: deviations, p_value }
}

fn verdict(
    search: &Search,
    outcome: &SearchOutcome,
    competing: &[CompetingHypotheses],
    left: Option<&Unexplained>,
) -> Verdict {
    if outcome.rounds.is_empty() || moving_s(search) < MOVING_MIN_S {
        return Verdict::InsufficientData;
    }
    let effects = &outcome.fit.model.effects;
    if left.is_some_and(|left| !left.is_noise()) {
        return Verdict::Unknown;
    }
    if effects.is_empty() {
        // Evidence for a number at a bound is evidence for something, if not for that number.
        let is_left = left.is_some_and(|left| !left.refused.is_empty());
        return if is_left { Verdict::Unknown } else { Verdict::None };
    }
    if outcome.fit.model.has(EffectKind::Unknown) {
        let total = outcome.base.cost - outcome.fit.cost;
        let index = outcome.fit.model.position(EffectKind::Unknown);
        let without = index.map(|index| search.without(&outcome.fit, index));
        let library = without.map_or(0.0, |fit| outcome.base.cost - fit.cost);
        if library < LIBRARY_SHARE_MIN * total {
            return Verdict::Unknown;
        }
    }
    if competing.is_empty() { Verdict::Effect } else { Verdict::Ambiguous }
}

fn considered(outcome: &SearchOutcome, competing: &[CompetingHypotheses]) -> Vec<Considered> {
    let mut list: Vec<Considered> = Vec::new();
    if let Some(last) = outcome.rounds.last() {
        for trial in last.iter() {
            let fallen = outcome.fallen.iter().find(|(kind, _)| *kind == trial.kind);
            let reason = if outcome.fit.model.has(trial.kind) {
                "found".into()
            } else if let Some((_, refusal)) = fallen {
                format!("found, but beside the usual errors: {refusal}")
            } else if competing.iter().any(|it| it.kinds.contains(&trial.kind)) {
                "explains the data as well".into()
            } else {
                Search::refusal(trial).map_or_else(
                    || "explains the data, but less well than what was found".into(),
                    |refusal| refusal.to_string(),
                )
            };
            list.push(Considered {
                kind: trial.kind.name(),
                evidence: Some(trial.evidence),
                reason,
            });
        }
    }
    for trial in outcome.small_trials() {
        let reason = format!("certain and small: {}", small(outcome, trial));
        list.push(Considered { kind: trial.kind.name(), evidence: Some(trial.evidence), reason });
    }
    for trial in outcome.small_or_none_trials() {
        let reason = "certain and small, but jointly with the usual errors it may be none".into();
        list.push(Considered { kind: trial.kind.name(), evidence: Some(trial.evidence), reason });
    }
    for (kind, reason) in &outcome.not_testable {
        list.push(Considered { kind: kind.name(), evidence: None, reason: reason.clone() });
    }
    list
}

/// Returns the verdict in words, and the recommended action.
fn worded(
    search: &Search,
    outcome: &SearchOutcome,
    verdict: Verdict,
    effects: &[EffectAnswer],
    competing: &[CompetingHypotheses],
    left: Option<&Unexplained>,
    known: &FinishedFit,
) -> Words {
    let undetermined = left.map(Unexplained::undetermined).unwrap_or_default();
    let (more, experiment) = match verdict {
        Verdict::InsufficientData if search.problem.runs.is_empty() => {
            let held_out = search.holdout.len();
            let text = format!("No run is there to fit: all {held_out} are held out.");
            return (
                VerdictWords::from_text(text),
                Some("Give some of the runs the role \"fit\".".into()),
            );
        }
        Verdict::InsufficientData => {
            let moving_s = moving_s(search);
            let observations = outcome.base.observations();
            let text = format!(
                "The fit runs hold {moving_s:.0} s of usable motion ({observations} observations): too little to explain."
            );
            let experiment = "Record several runs of some minutes, in both directions.";
            return (VerdictWords::from_text(text), Some(experiment.into()));
        }
        Verdict::None => {
            let small: Vec<String> = outcome.small_trials().map(|it| small(outcome, it)).collect();
            let small = match &small[..] {
                [] => String::new(),
                all => format!(" Certain, and too small to matter: {}.", all.join(", ")),
            };
            (small, None)
        }
        Verdict::Effect => (String::new(), None),
        Verdict::Unknown => {
            let is_form = outcome.fit.model.has(EffectKind::Unknown);
            let residual = left.filter(|_| !is_form).map_or_else(String::new, residual);
            let experiment = "Drive this range again with other speeds, loads and directions.";
            (residual, Some(experiment.into()))
        }
        Verdict::Ambiguous => {
            let runs = competing.iter().map(|it| separating_run(it.accepted, &it.kinds));
            let mut experiments: Vec<&str> = runs.collect();
            experiments.dedup();
            let experiment = (!experiments.is_empty()).then(|| experiments.join(" "));
            (String::new(), experiment)
        }
    };
    let words = verdict_words(verdict, effects, competing, more + &undetermined);
    let is_none = verdict == Verdict::None;
    (if is_none { or_changing(words, known) } else { words }, experiment)
}

/// Returns the words of a verdict of no effect; where one is there that changes over the runs, those about it.
fn or_changing(words: VerdictWords, known: &FinishedFit) -> VerdictWords {
    let kinds: Vec<&str> = known.courses.iter().map(|(kind, _)| kind.name()).collect();
    if kinds.is_empty() {
        return words;
    }
    let heading = changing(&kinds);
    VerdictWords { whole: heading.clone(), heading, ..words }
}

/// Describes a residual that nothing in the model stands for.
fn residual(left: &Unexplained) -> String {
    let place = left.place.as_ref().and_then(located);
    let place = place.map_or_else(String::new, |place| format!(" It lives most here: {place}."));
    left.describe() + &place
}
