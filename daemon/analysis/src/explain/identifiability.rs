//! Numbers of train and line that the data determine or leave open, apart from the effects found.
//!
//! Every kind of the library that has one number for the whole train or line, and was not found, is added to the
//! finished model at no effect. The information matrix then gives the standard deviation of its number, and shows
//! whether the kind is distinguishable from each of the others.

use dynocar_model::words::{kind_name, number, parameter};
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::{EffectKind, KindRow};
use nalgebra::Cholesky;

use super::answer::Identifiability;
use super::competing::separating_run;
use super::effects::{Candidate, LIBRARY};
use super::selection::{Search, SearchOutcome};

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
