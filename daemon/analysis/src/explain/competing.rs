//! Kinds that could stand in the place of an accepted effect, and other forms that a force outside the library may have.

use dynocar_shared::vocabulary::{self, EffectKind};

use super::answer::RunnerUp;
use super::effects::{SharedHypothesis, UNKNOWN};
use super::evidence::{EQUAL, SCORE_MIN};
use super::selection::{
    EffectTrial, Refusal, Search, SearchOutcome, is_certain_with_nuisance, penalty,
};
use crate::statistics::least_first;

/// Least share of the accepted effect's error reduction, and of the least acceptance score, that a competing hypothesis
/// must reach.
const COMPETING_SHARE: f64 = 0.7;

/// An accepted effect and the kinds that could stand in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct CompetingHypotheses {
    /// The kind that was accepted.
    pub accepted: EffectKind,
    /// The others.
    pub kinds: Vec<EffectKind>,
}

/// For each accepted effect that has some, the kinds that could stand in its place.
///
/// A competing hypothesis explains the data as well, would be accepted as the accepted effect was, removes about as
/// much of the open-loop error, and has nothing left to explain once that effect is in the model: a kind that keeps its
/// evidence acts jointly with the effect and not in its place. It must fit the runs as well in the finished model, too,
/// which may separate kinds that looked alike in the search. Kinds that no run could distinguish from the effect compete
/// in any case.
pub fn competing_hypotheses(search: &Search, outcome: &SearchOutcome) -> Vec<CompetingHypotheses> {
    let effects = &outcome.fit.model.effects;
    let of = |accepted: EffectKind, tried: &[EffectTrial], twins: &[EffectKind]| {
        let own = tried.iter().find(|trial| trial.kind == accepted);
        let is_other = |kind: EffectKind| !outcome.fit.model.has(kind);
        let close = tried.iter().filter(|trial| {
            is_other(trial.kind)
                && own.is_some_and(|own| comes_close(trial, own, outcome))
                && fits_as_well(search, trial, accepted, outcome)
        });
        let mut kinds: Vec<EffectKind> = Vec::new();
        for kind in twins.iter().copied().chain(close.map(|trial| trial.kind)) {
            if is_other(kind) && !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        CompetingHypotheses { accepted, kinds }
    };
    let named = effects.iter().filter(|effect| outcome.is_named(effect.kind()));
    let each = named.map(|effect| {
        let kind = effect.kind();
        let swapped = outcome.instead.iter().filter(|_| effects.len() > 1);
        let instead = outcome.certain.iter().chain(swapped).find(|(stands, _)| *stands == kind);
        // The trials of the round in which it was taken in.
        let mut rounds = outcome.rounds.iter().rev();
        let taken_in = rounds.find(|round| round.iter().any(|trial| trial.kind == kind));
        let taken_in = taken_in.map_or(&[][..], |round| &round[..]);
        let twins = effect.twins(outcome.values(kind).unwrap_or_default());
        of(kind, instead.map_or(taken_in, |(_, tried)| tried), twins)
    });
    each.filter(|competing| !competing.kinds.is_empty()).collect()
}

/// Returns whether a trial could stand in the place of the accepted one in the finished model, at its own place or at
/// that of the accepted one.
fn fits_as_well(
    search: &Search,
    trial: &EffectTrial,
    accepted: EffectKind,
    outcome: &SearchOutcome,
) -> bool {
    let finished = &outcome.likeliest;
    let Some(index) = finished.model.position(accepted) else { return false };
    let rest = search.without(finished, index);
    let with = |effect: SharedHypothesis, start: Vec<f64>| {
        let fit = search.problem.grown(&rest, [(effect, start)]);
        fit.cost + penalty(&fit, fit.model.effects.len() - 1)
    };
    let own = finished.model.effects[index].clone();
    let (effect, start) = trial.last_parts();
    let at_its_place = own.site().and_then(|site| effect.at_site(site.clone()));
    // Fitted again like the others: the finished fit has come further.
    let own = with(own, finished.effect_parameters(index).to_vec());
    let mut others = [Some(effect), at_its_place].into_iter().flatten();
    others.any(|effect| with(effect, start.clone()) < own + EQUAL)
}

/// Returns whether a trial could stand in the place of the accepted one as the search saw them.
fn comes_close(trial: &EffectTrial, accepted: &EffectTrial, outcome: &SearchOutcome) -> bool {
    let last = outcome.rounds.last().into_iter().flat_map(|round| round.iter());
    let left = last.clone().find(|left| left.kind == trial.kind).map_or(0.0, |left| left.evidence);
    let may_be = match Search::refusal(trial) {
        _ if outcome.is_certain(accepted.kind) => is_certain_with_nuisance(trial, trial.bic_gain),
        None => true,
        // A trial is strong enough if its acceptance score comes close to the least one, which the accepted effect
        // exceeded.
        Some(Refusal::Weak(_)) => {
            accepted.acceptance_score() > SCORE_MIN
                && trial.acceptance_score() > COMPETING_SHARE * SCORE_MIN
        }
        Some(_) => false,
    };
    trial.kind != EffectKind::Unknown
        && trial.fit.model.effects[trial.last()].nature().may_stand_for_others
        && may_be
        && trial.bic_gain > accepted.bic_gain - EQUAL
        && trial.reduction > COMPETING_SHARE * accepted.reduction.max(0.0)
        && left < 0.5 * trial.evidence
}

/// Returns the kinds that could stand in the place of some effect, each once.
pub fn kinds_of(competing: &[CompetingHypotheses]) -> Vec<&'static str> {
    let mut kinds: Vec<&'static str> = Vec::new();
    for kind in competing.iter().flat_map(|it| &it.kinds) {
        if !kinds.contains(&kind.name()) {
            kinds.push(kind.name());
        }
    }
    kinds
}

/// Returns the run that is known to separate kinds that are easily confused.
pub fn separating_run(kind: EffectKind, competing: &[EffectKind]) -> &'static str {
    vocabulary::separating_run(kind, competing)
        .unwrap_or("Drive again with other speeds, loads, directions and weather.")
}

/// Runners-up at most.
const SHOWN: usize = 3;

/// Returns a formula without its numbers.
fn form(formula: String) -> String {
    formula
        .chars()
        .filter(|letter| !(letter.is_ascii_digit() || ".-+−".contains(*letter)))
        .collect()
}

/// Returns the forms next best to the one that was found, each fitted with everything else; empty where
/// nothing outside the library was found.
pub fn runners_up(search: &Search, outcome: &SearchOutcome) -> Vec<RunnerUp> {
    let fit = &outcome.fit;
    let Some(index) = fit.model.position(EffectKind::Unknown) else { return Vec::new() };
    let found = fit.model.effects[index].formula(fit.effect_parameters(index)).map(form);
    let own = fit.cost + penalty(fit, index);
    let rest = search.without(fit, index);
    let onto = search.problem.again(&rest, fit.noise);
    let Some(scan) = search.scan(&onto) else { return Vec::new() };
    let candidates = UNKNOWN.propose(&scan).unwrap_or_default();
    let mut others: Vec<RunnerUp> = candidates
        .into_iter()
        .filter_map(|candidate| {
            let other = search.problem.grown(&onto, [candidate.parts()]);
            let last = other.model.effects.len() - 1;
            let formula = other.model.effects[last].formula(other.effect_parameters(last))?;
            let evidence_less = other.cost + penalty(&other, last) - own;
            Some(RunnerUp { formula, evidence_less })
        })
        .filter(|other| found != Some(form(other.formula.clone())))
        .collect();
    least_first(&mut others, |it| it.evidence_less);
    others.truncate(SHOWN);
    others
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_that_could_stand_in_the_place_of_two_effects_is_named_once() {
        let of = |accepted, kinds: &[EffectKind]| CompetingHypotheses {
            accepted,
            kinds: kinds.to_vec(),
        };
        let competing = [
            of(EffectKind::TunnelDrag, &[EffectKind::Wind, EffectKind::LocalResistance]),
            of(EffectKind::TractionGain, &[EffectKind::Wind]),
        ];
        assert_eq!(kinds_of(&competing), ["wind", "local_resistance"]);
    }
}
