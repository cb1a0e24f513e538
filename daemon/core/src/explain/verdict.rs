//! From the search to the answer.

use std::collections::BTreeMap;

use dynocar_shared::vocabulary::EffectKind;

use super::answer::{
    Answer, BaseAnswer, Considered, DavisDeviations, EffectAnswer, ParameterValue, Verdict,
};
use super::effects::ReportContext;
use super::evidence::Fit;
use super::score::{self, Score};
use super::selection::{
    AMBIGUOUS, EVIDENCE_MIN, Outcome, Search, Trial, deviations, discounted, p_value, penalty,
};
use crate::simulate::SpeedError;

/// A rival takes away this share of what the accepted effect does of the open-loop error.
const RIVAL_REDUCTION_SHARE: f64 = 0.7;
/// Moving time in s of the fit runs below which nothing is said.
const MOVING_MIN_S: f64 = 180.0;
/// Share of the decrease that the library must explain when something unknown is left too.
const LIBRARY_SHARE_MIN: f64 = 0.5;

/// The answer to a finished search.
pub fn answer(search: &Search, outcome: &Outcome, score: &Score) -> Answer {
    let fit = &outcome.fit;
    let (deviation, covariance) = deviations(fit);
    let effects = effect_answers(search, outcome, &deviation, &covariance);
    let rivals = rivals(outcome);
    let verdict = verdict(search, outcome, &rivals);
    let [rmse_before, rmse_after] = score.holdout_rmse_mps();
    let pair = |errors: [SpeedError; 2]| Some([errors[0].rmse_mps()?, errors[1].rmse_mps()?]);
    let (statement, experiment) = statement(search, outcome, verdict, &effects, &rivals);
    Answer {
        verdict,
        statement,
        effects,
        ambiguous_with: rivals.iter().map(|kind| kind.name()).collect(),
        experiment,
        base: BaseAnswer {
            a: fit.theta[0],
            b: fit.theta[1],
            c: fit.theta[2],
            std: DavisDeviations { a: deviation[0], b: deviation[1], c: deviation[2] },
        },
        metric: "full_run",
        rmse_before,
        rmse_after,
        error_reduction_interval: score.reduction_interval(),
        window60: pair(score.holdout_window60),
        fit_runs: pair(score.fit_runs),
        considered: considered(outcome),
        predictions: BTreeMap::new(),
    }
}

fn effect_answers(
    search: &Search,
    outcome: &Outcome,
    deviation: &[f64],
    covariance: &nalgebra::DMatrix<f64>,
) -> Vec<EffectAnswer> {
    let fit = &outcome.fit;
    let mut answers: Vec<(f64, EffectAnswer)> = fit
        .model
        .effects
        .iter()
        .zip(fit.model.ranges())
        .enumerate()
        .map(|(index, (effect, range))| {
            let rest = search.without(fit, index);
            let decrease = discounted(fit, index, rest.cost - fit.cost);
            let reduction = score::reduction_on_fit_runs(search.problem, &rest, fit);
            let weights = search.problem.runs.iter().filter_map(|run| run.samples().first());
            let weight_kn = weights.map(|sample| sample.weight_kn).sum::<f64>()
                / search.problem.runs.len().max(1) as f64;
            let reported = effect.report(&ReportContext {
                parameters: &fit.theta[range.clone()],
                deviations: &deviation[range.clone()],
                c: fit.theta[2],
                c_deviation: deviation[2],
                c_covariance: covariance[(2, range.start)],
                weight_kn,
            });
            let answer = EffectAnswer {
                kind: effect.kind().name(),
                place: effect.place(),
                parameters: reported.values,
                std: reported.deviations,
                p_value: p_value((decrease - penalty(effect, fit.observations())) * reduction),
                error_reduction: reduction,
            };
            (decrease, answer)
        })
        .collect();
    answers.sort_by(|one, other| other.0.total_cmp(&one.0));
    answers.into_iter().map(|(_, answer)| answer).collect()
}

/// Kinds that could stand in the place of the effect accepted last.
///
/// A rival explains the data as well, takes away about as much of the open-loop error, and has
/// nothing left to explain once the effect is in: what keeps its evidence acts beside the effect
/// and not in its place.
fn rivals(outcome: &Outcome) -> Vec<EffectKind> {
    let Some(accepted) = accepted_round(outcome) else { return Vec::new() };
    let Some(best) = accepted.iter().find(|trial| is_in(&outcome.fit, trial.kind)) else {
        return Vec::new();
    };
    let left = |kind: EffectKind| {
        let last = outcome.rounds.last().into_iter().flatten().find(|trial| trial.kind == kind);
        last.map_or(0.0, |trial| trial.evidence)
    };
    accepted
        .iter()
        .filter(|trial| {
            !is_in(&outcome.fit, trial.kind)
                && trial.kind != EffectKind::Unknown
                && trial.evidence > best.evidence - AMBIGUOUS
                && trial.evidence > EVIDENCE_MIN
                && left(trial.kind) < 0.5 * trial.evidence
                && trial.reduction > RIVAL_REDUCTION_SHARE * best.reduction
        })
        .map(|trial| trial.kind)
        .collect()
}

fn is_in(fit: &Fit, kind: EffectKind) -> bool {
    fit.model.effects.iter().any(|effect| effect.kind() == kind)
}

/// The last round that added an effect.
fn accepted_round(outcome: &Outcome) -> Option<&Vec<Trial>> {
    let count = outcome.fit.model.effects.len();
    count.checked_sub(1).and_then(|index| outcome.rounds.get(index))
}

fn verdict(search: &Search, outcome: &Outcome, rivals: &[EffectKind]) -> Verdict {
    let moving_s: f64 = search.problem.runs.iter().map(|run| run.moving_s()).sum();
    if outcome.rounds.is_empty() || moving_s < MOVING_MIN_S {
        return Verdict::InsufficientData;
    }
    let effects = &outcome.fit.model.effects;
    if effects.is_empty() {
        return Verdict::None;
    }
    if is_in(&outcome.fit, EffectKind::Unknown) {
        let total = outcome.base.cost - outcome.fit.cost;
        let index = effects.iter().position(|effect| effect.kind() == EffectKind::Unknown);
        let without = index.map(|index| search.without(&outcome.fit, index));
        let library = without.map_or(0.0, |fit| outcome.base.cost - fit.cost);
        if library < LIBRARY_SHARE_MIN * total {
            return Verdict::Unknown;
        }
    }
    if rivals.is_empty() { Verdict::Effect } else { Verdict::Ambiguous }
}

fn considered(outcome: &Outcome) -> Vec<Considered> {
    let mut list: Vec<Considered> = Vec::new();
    if let Some(last) = outcome.rounds.last() {
        for trial in last {
            let remark = if is_in(&outcome.fit, trial.kind) {
                "found"
            } else if trial.evidence > EVIDENCE_MIN {
                "explains the data, but less well or too little of the error"
            } else if trial.evidence > 0.0 {
                "not significant for a search over the whole library"
            } else {
                "explains no more than chance"
            };
            list.push(Considered {
                kind: trial.kind.name(),
                evidence: Some(trial.evidence),
                remark: remark.into(),
            });
        }
    }
    for (kind, reason) in &outcome.not_testable {
        list.push(Considered { kind: kind.name(), evidence: None, remark: reason.clone() });
    }
    list
}

fn statement(
    search: &Search,
    outcome: &Outcome,
    verdict: Verdict,
    effects: &[EffectAnswer],
    rivals: &[EffectKind],
) -> (String, Option<String>) {
    let described: Vec<String> = effects.iter().map(describe).collect();
    let described = described.join("; ");
    match verdict {
        Verdict::InsufficientData => {
            let moving_s: f64 = search.problem.runs.iter().map(|run| run.moving_s()).sum();
            let observations = outcome.base.observations();
            let text = format!(
                "The fit runs hold {moving_s:.0} s of usable motion ({observations} observations): too little to tell."
            );
            (text, Some("Record several runs of some minutes, in both directions.".into()))
        }
        Verdict::None => {
            ("Nothing undeclared is found: the declared model with a, b, c refitted explains the runs.".into(), None)
        }
        Verdict::Effect => (format!("Found: {described}."), None),
        Verdict::Unknown => (
            format!(
                "The residual is real, but no effect of the library explains it; it lives here: {described}."
            ),
            Some("Drive this range again with other speeds, loads and directions.".into()),
        ),
        Verdict::Ambiguous => {
            let names: Vec<&str> = rivals.iter().map(|kind| kind.name()).collect();
            let first = effects.first().map_or("", |effect| effect.kind);
            let text = format!(
                "An effect acts, but {first} and {} explain it equally well on these runs ({described}).",
                names.join(", ")
            );
            let kind = effects.first().and_then(|effect| EffectKind::from_name(effect.kind));
            let experiment = kind.map(|kind| separating_run(kind, rivals));
            (text, experiment)
        }
    }
}

/// What is known to separate the kinds that are easily confused.
fn separating_run(kind: EffectKind, rivals: &[EffectKind]) -> String {
    use EffectKind::{
        AmbientTemperature, BearingTemperature, CurveResistance, DraggingBrake, GradientShift,
        LocalResistance, MassChange, RotatingMass, TractionGain, TunnelDrag, WheelDiameter, Wind,
    };
    let has = |wanted: EffectKind| kind == wanted || rivals.contains(&wanted);
    let pairs: [(EffectKind, EffectKind, &str); 9] = [
        (
            MassChange,
            TractionGain,
            "coast down a known gradient: a mass is felt there, a gain is not",
        ),
        (
            MassChange,
            RotatingMass,
            "pass a steep gradient at other loads: the rotating mass does not feel it",
        ),
        (
            RotatingMass,
            TractionGain,
            "compare accelerating with braking: a gain acts on traction only",
        ),
        (RotatingMass, WheelDiameter, "compare the odometer with balises over several kilometres"),
        (TunnelDrag, Wind, "pass the portals in both directions and on another day"),
        (TunnelDrag, LocalResistance, "pass the place at clearly different speeds"),
        (
            CurveResistance,
            GradientShift,
            "pass the curves in both directions: a gradient changes its sign",
        ),
        (
            DraggingBrake,
            BearingTemperature,
            "read the brake-cylinder pressure while released, and let the train run on",
        ),
        (AmbientTemperature, BearingTemperature, "start warm on a cold day and cold on a warm one"),
    ];
    pairs
        .iter()
        .find(|(one, other, _)| has(*one) && has(*other))
        .map_or("Drive again with other speeds, loads, directions and weather.".into(), |pair| {
            format!("To separate them, {}.", pair.2)
        })
}

fn describe(effect: &EffectAnswer) -> String {
    let mut parts = Vec::new();
    for (name, value) in &effect.parameters {
        if let (ParameterValue::Number(value), Some(ParameterValue::Number(deviation))) =
            (value, effect.std.get(name))
        {
            parts.push(format!("{name} = {value:.4} ± {:.4}", 1.96 * deviation));
        }
    }
    if let Some(intervals) = &effect.place.intervals_m {
        let shown = intervals.iter().take(4).map(|[from, to]| format!("{from:.0}–{to:.0} m"));
        let more = if intervals.len() > 4 { " …" } else { "" };
        parts.push(format!("at {}{more}", shown.collect::<Vec<_>>().join(", ")));
    }
    if let Some(windows) = &effect.place.windows {
        let shown =
            windows.iter().map(|w| format!("{} {:.0}–{:.0} s", w.run, w.t_start_s, w.t_end_s));
        parts.push(format!("in {}", shown.collect::<Vec<_>>().join(", ")));
    }
    if let Some(runs) = &effect.place.runs {
        parts.push(format!("in {}", runs.join(", ")));
    }
    if let Some(covariate) = &effect.place.covariate {
        let [low, high] = covariate.range;
        parts.push(format!("{} from {low:.1} to {high:.1}", covariate.name));
    }
    format!("{} ({})", effect.kind, parts.join(", "))
}
