//! Limits of a verdict, in words, and the numbers of train and line that the data determine or leave open: a, b, c, and
//! those of kinds that were not found.
//!
//! Every kind of the library that has one number for the whole train or line, and was not found, is added to the
//! finished model at no effect. The information matrix then gives the standard deviation of its number, and shows
//! whether the kind is distinguishable from each of the others.

use std::collections::BTreeMap;

use dynocar_model::words::{kind_name, number, parameter};
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::{EffectKind, KindRow};
use nalgebra::Cholesky;

use super::answer::{Course, DavisDeviations, EffectAnswer, Identifiability, PlaceUncertainty};
use super::competing::separating_run;
use super::effects::{Candidate, LIBRARY};
use super::evidence::{Fit, FitProblem};
use super::held_out::HeldOutEffect;
use super::report::effect::{by_held_out_runs, small};
use super::score::PredictionScore;
use super::selection::{Deviations, Search, SearchOutcome};
use crate::statistics::share_of;

/// Uncertainty of the numbers of a finished search.
pub struct FinishedFit<'a> {
    /// The standard deviations.
    pub deviations: &'a Deviations,
    /// The uncertainty of each effect's place.
    pub places: &'a [Option<PlaceUncertainty>],
    /// The numbers that change over the runs.
    pub courses: &'a [(EffectKind, Vec<Course>)],
    /// Numbers of each effect by the runs held out alone.
    pub held_out: &'a [Option<HeldOutEffect>],
}

impl FinishedFit<'_> {
    /// Returns the courses of an effect.
    pub fn courses(&self, kind: EffectKind) -> Vec<Course> {
        let own = self.courses.iter().filter(|it| it.0 == kind);
        own.flat_map(|it| it.1.clone()).collect()
    }

    /// Returns the courses of kinds that are not among the named effects, by kind.
    pub fn unnamed_courses(&self, effects: &[EffectAnswer]) -> BTreeMap<&'static str, Vec<Course>> {
        let is_named = |kind: EffectKind| effects.iter().any(|it| it.kind == kind.name());
        let unnamed = self.courses.iter().filter(|it| !is_named(it.0));
        unnamed.map(|(kind, all)| (kind.name(), all.clone())).collect()
    }
}

/// Returns the limits of a verdict.
pub fn caveats(
    search: &Search,
    outcome: &SearchOutcome,
    effects: &[EffectAnswer],
    known: &FinishedFit,
    score: &PredictionScore,
    identifiability: &[Identifiability],
) -> Vec<String> {
    let contradictions = effects.iter().filter_map(|effect| effect.contradiction.clone());
    let mut caveats: Vec<String> = contradictions.map(|it| format!(" {it}")).collect();
    caveats.dedup();
    let courses = known.courses.iter().flat_map(|(kind, all)| {
        let is_named = effects.iter().any(|effect| effect.kind == kind.name());
        all.iter().map(move |course| format!(" {}", course.sentence(kind.name(), is_named)))
    });
    caveats.extend(courses);
    caveats.extend(effects.iter().filter_map(by_held_out_runs));
    caveats.extend([worse_held_out(effects, score), small_effects(outcome, effects)]);
    caveats.push(undetermined(search.problem, &outcome.fit, &known.deviations.std));
    if search.problem.runs.iter().any(|run| run.are_loads_estimated) {
        caveats.push(
            " No sample weighs the load: after each stop it is what the traction force moves, so that a wrong scale \
             of that force would show as another load, and as a wrong brake."
                .into(),
        );
    }
    caveats.extend(not_held(identifiability));
    caveats
}

/// Sentences without the space before them, and none that is empty.
pub fn trimmed(sentences: &[String]) -> Vec<String> {
    let trimmed = sentences.iter().map(|it| it.trim().to_owned());
    trimmed.filter(|it| !it.is_empty()).collect()
}

/// Describes the certain and small effects in addition to the named ones; empty if either are missing.
fn small_effects(outcome: &SearchOutcome, effects: &[EffectAnswer]) -> String {
    let small: Vec<String> = outcome.small_trials().map(|it| small(outcome, it)).collect();
    if small.is_empty() || effects.is_empty() {
        return String::new();
    }
    format!(" Certain, small, and part of the updated model: {}.", small.join(", "))
}

/// States that the runs held out are predicted worse with the findings; empty when they are not.
fn worse_held_out(effects: &[EffectAnswer], score: &PredictionScore) -> String {
    let Some(judged) = score.judged() else { return String::new() };
    let [before, after] = judged.error_mps;
    let [shown_before, shown_after] = [before, after].map(|error| format!("{error:.3}"));
    if effects.is_empty() || after <= before || shown_after == shown_before {
        return String::new();
    }
    let acts_in_runs = |it: &EffectAnswer| it.place.runs.is_some() || it.place.windows.is_some();
    let why = match judged.reduction_interval_95 {
        _ if effects.iter().all(acts_in_runs) => {
            "it was found in single runs, and is not looked for in those held out. Where they err most, it may \
             act too: fit them (role = \"fit\") to find out."
                .to_owned()
        }
        Some([low, high]) if high > 0.0 => format!(
            "this may be chance, the 95 % interval of what it removes is {:.0} to {:.0} %.",
            100.0 * low,
            100.0 * high
        ),
        _ => "it holds for the runs that were fitted, not for those.".to_owned(),
    };
    format!(
        " The runs held out are predicted worse with it{}, {shown_before} m/s before and \
         {shown_after} after: {why}",
        judged.predicted()
    )
}

/// Data that take away less than this share of a coefficient's variance do not determine it.
const ESTIMATED_MIN: f64 = 0.5;

/// Speeds that spread over less than this share of the greatest are one speed.
const VARIED_MIN: f64 = 0.5;

/// Returns the share of the variance of a, b and c before the data that the data take away: 1 where they say
/// all, 0 where they say nothing.
pub fn told_by_data(problem: &FitProblem, deviation: &[f64]) -> DavisDeviations {
    let share = |i: usize| {
        let left = deviation[i] / problem.prior_deviation(i);
        if left.is_finite() { (1.0 - left * left).clamp(0.0, 1.0) } else { 0.0 }
    };
    DavisDeviations { a: share(0), b: share(1), c: share(2) }
}

/// Returns in words which of a, b and c the data hardly determine, and which runs would; empty when all are determined.
pub fn undetermined(problem: &FitProblem, fit: &Fit, deviation: &[f64]) -> String {
    let DavisDeviations { a, b, c } = told_by_data(problem, deviation);
    let names = [("a", a), ("b", b), ("c", c)];
    let names: Vec<&str> =
        names.into_iter().filter(|(_, told)| *told < ESTIMATED_MIN).map(|(name, _)| name).collect();
    let speeds: Vec<f64> =
        problem.runs.iter().flat_map(|run| run.bins.iter().map(|bin| bin.speed_mps)).collect();
    if names.is_empty() || speeds.is_empty() {
        return String::new();
    }
    let [slow_mps, usual_mps, fast_mps] = [0.05, 0.5, 0.95].map(|it| share_of(&speeds, it));
    let usual = fit.theta[0] + usual_mps * (fit.theta[1] + usual_mps * fit.theta[2]);
    let advice = if fast_mps - slow_mps < VARIED_MIN * fast_mps {
        "Other speeds would determine them, best by coasting"
    } else {
        "More runs would, or quieter ones"
    };
    format!(
        " These data hardly determine {}: nine tenths of the motion lie between {slow_mps:.1} and \
         {fast_mps:.1} m/s, and what is known of {} is mostly the declared tolerance. Their sum at \
         {usual_mps:.1} m/s is {usual:.2} N/kN. {advice}.",
        names.join(", "),
        if names.len() == 1 { "it" } else { "them" },
    )
}

/// Returns the kinds that have one number for the whole train or line and were not found.
fn whole_kinds(search: &Search, outcome: &SearchOutcome) -> Vec<Candidate> {
    let Some(scan) = search.scan(&outcome.fit) else { return Vec::new() };
    let others = LIBRARY.iter().filter(|effect| !outcome.fit.model.has(effect.kind));
    others.filter_map(|effect| effect.whole(&scan)).collect()
}

/// Returns the information of the data on each number that was not found.
pub fn identifiability(search: &Search, outcome: &SearchOutcome) -> Vec<Identifiability> {
    let kinds = whole_kinds(search, outcome);
    let fitted = outcome.fit.theta.len();
    let mut model = outcome.fit.model.clone();
    let mut theta = outcome.fit.theta.clone();
    for candidate in &kinds {
        model = model.with(candidate.hypothesis.clone());
        theta.push(candidate.hypothesis.none());
    }
    let information = search.problem.at(&model, theta, outcome.fit.noise).information();
    // Standard deviation of one kind, estimated jointly with the fitted parameters and with the other kind, if given.
    let std = |own: usize, other: Option<usize>| {
        let free: Vec<usize> =
            (0..fitted).chain(other.map(|k| fitted + k)).chain([fitted + own]).collect();
        let part = information.select_rows(&free).select_columns(&free);
        let covariance = Cholesky::new(part)?.inverse();
        let last = free.len() - 1;
        Some(covariance[(last, last)].sqrt()).filter(|std| std.is_finite())
    };
    let is_determined = |own: usize, std: Option<f64>| {
        let hypothesis = &kinds[own].hypothesis;
        let counts =
            |size: f64| hypothesis.is_material(&[hypothesis.none() + size], outcome.fit.theta[2]);
        std.is_some_and(|std| !counts(HALF_95 * std) && !counts(-HALF_95 * std))
    };
    let one = |own: usize| {
        let alone = std(own, None);
        let told = is_determined(own, alone);
        let is_alike =
            |&other: &usize| other != own && told && !is_determined(own, std(own, Some(other)));
        let alike = (0..kinds.len()).filter(is_alike);
        let hypothesis = &kinds[own].hypothesis;
        Identifiability {
            kind: hypothesis.kind().name(),
            parameter: hypothesis.parameters()[0].name,
            std: alone,
            told,
            alike: alike.map(|other| kinds[other].hypothesis.kind().name()).collect(),
        }
    };
    (0..kinds.len()).map(one).collect()
}

/// Returns in words the effects that the data would not show and the pairs of kinds that they cannot distinguish, each
/// with the runs that would; empty where the data determine all.
pub fn not_held(all: &[Identifiability]) -> Vec<String> {
    let would = |own: &Identifiability| {
        EffectKind::from_name(own.kind).map_or("more runs", |kind| KindRow::of(kind).determined_by)
    };
    let hidden: Vec<String> = all
        .iter()
        .filter(|own| !own.told)
        .map(|own| match own.hidden_up_to() {
            Some(most) => {
                let (words, unit) = parameter(own.parameter);
                let most = [&number(most, Some(most)), unit].join(" ");
                format!(
                    "{} ({words} is known to ± {} only; {} would determine it)",
                    kind_name(own.kind),
                    most.trim_end(),
                    would(own)
                )
            }
            None => format!("{} ({} would determine it)", kind_name(own.kind), would(own)),
        })
        .collect();
    let mut caveats = Vec::new();
    if !hidden.is_empty() {
        caveats.push(format!(" Not to be judged from these runs: {}.", hidden.join(", ")));
    }
    for (index, own) in all.iter().enumerate() {
        let pair = |other: &&Identifiability| own.alike.contains(&other.kind);
        for other in all[index + 1..].iter().filter(pair) {
            let kinds = [own.kind, other.kind].map(EffectKind::from_name);
            let run = match kinds {
                [Some(one), Some(other)] => separating_run(one, &[other]),
                _ => "",
            };
            let [own, other] = [own.kind, other.kind].map(kind_name);
            caveats.push(format!(" In them {own} and {other} look alike. {run}"));
        }
    }
    caveats
}
