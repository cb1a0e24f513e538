//! Whether what was tried is more than chance, large enough to matter, and seen in the runs: what accepts an effect,
//! that it takes much from the error for its evidence or that it is certain, and why one is not accepted.

use dynocar_shared::vocabulary::EffectKind;

use super::by_run::{deviations, scatter_factor};
use super::outcome::{EffectTrial, SearchOutcome};
use super::price::{at_bound, penalty};
use super::refusal::Refusal;
use super::search::Search;
use crate::explain::effects::{Certainty, SharedHypothesis, policy_of};
use crate::explain::evidence::{
    CERTAIN_STDS, CERTAIN_STDS_BY_RUN, EQUAL, Fit, OUTSIDE_COST, SCORE_MIN, acceptance_score,
};

impl Search<'_> {
    /// Why the last effect of a trial is not accepted; `None` when it is.
    pub fn refusal(trial: &EffectTrial) -> Option<Refusal> {
        if trial.evidence <= 0.0 {
            Some(Refusal::Chance)
        } else if !is_material(trial) {
            Some(Refusal::Immaterial)
        } else if !is_accepted(&trial.fit, trial.last(), trial.evidence, trial.reduction) {
            Some(Refusal::Weak(trial.reduction))
        } else {
            contradiction_of(&trial.fit, trial.last())
                .map(Refusal::Contradiction)
                .or_else(|| at_bound(&trial.fit, trial.last()).map(Refusal::AtBound))
        }
    }

    /// The greatest strength of the trials of the first round that only their strength may refuse:
    /// what is compared with its distribution where nothing acts.
    pub fn greatest_score(outcome: &SearchOutcome) -> f64 {
        let first = outcome.rounds.first().into_iter().flat_map(|round| round.iter());
        first
            .filter(|trial| is_material(trial) && is_possible(trial))
            .map(EffectTrial::acceptance_score)
            .fold(0.0, f64::max)
    }
}

/// Whether the last effect of a trial is larger than what declared figures are good for.
pub(super) fn is_material(trial: &EffectTrial) -> bool {
    let last = trial.last();
    let parameters = trial.fit.effect_parameters(last);
    trial.fit.model.effects[last].is_material(parameters, trial.fit.theta[2])
}

/// Whether the last effect of a trial may be what its kind says.
pub(super) fn is_possible(trial: &EffectTrial) -> bool {
    may_be(&trial.fit, trial.last())
}

/// Evidence beyond which one number of the whole train or line is certain. Where nothing acts it is at most 2, and
/// where everything declared is a little off, at most 26 for what is not in that world; beside the usual errors 8.
pub(super) const CERTAIN: f64 = 30.0;
/// Fewer runs agree on nothing.
pub(super) const CERTAIN_RUNS_MIN: usize = 3;

/// Whether an effect of a fitted model is more than chance and more than what declared figures are good for: it
/// takes much from the error for its evidence, or is certain.
pub(super) fn is_accepted(fit: &Fit, index: usize, evidence: f64, reduction: f64) -> bool {
    acceptance_score(evidence, reduction) > SCORE_MIN && is_shown(fit, index)
        || is_certain(fit, index, evidence, reduction, false)
}

/// Returns the score that decided for an effect of a fitted model: its acceptance score, or the least that accepts
/// where it was accepted because it is certain, here or beside the usual errors.
pub fn deciding_score(
    fit: &Fit,
    index: usize,
    (evidence, reduction): (f64, f64),
    is_certain_beside: bool,
) -> f64 {
    let score = acceptance_score(evidence, reduction);
    let is_certain = is_certain_beside || is_certain(fit, index, evidence, reduction, false);
    if is_certain { score.max(SCORE_MIN) } else { score }
}

/// Whether an effect is certain, however little it takes from the error: strong evidence for one number of the
/// whole train or line, less of it where it takes more, which the runs agree on. What is chosen among many must take
/// more from the error. Where a kind may be certain at all, its [policy](policy_of) says.
pub(super) fn is_certain(
    fit: &Fit,
    index: usize,
    evidence: f64,
    reduction: f64,
    is_beside_usual_errors: bool,
) -> bool {
    let effect = &fit.model.effects[index];
    let policy = policy_of(effect.kind());
    let is_by_run = effect.nature().is_one_number_a_run;
    let may_be_certain = match policy.certainty {
        Certainty::Anywhere => true,
        Certainty::BesideUsualErrors => is_beside_usual_errors,
        Certainty::Never => false,
    };
    let is_doubtful = policy.uncertain_beside.iter().any(|kind| fit.model.has(*kind));
    // Among the usual errors is the map's.
    let is_left = !is_beside_usual_errors
        && is_left_by_moved_places(effect)
        && fit.model.effects.iter().any(moves_places);
    let needs_the_score = !may_be_certain || is_doubtful || is_left;
    // The size of a form hangs on its shape, what it explains does not.
    let runs_agree = || match effect.kind() {
        EffectKind::Unknown => {
            let size = fit.model.ranges()[index].start;
            let gain = (evidence + penalty(fit, index)).max(0.0);
            gain.sqrt() > CERTAIN_STDS * scatter_factor(fit, size)
        }
        // Else it is not shown.
        _ if is_by_run => true,
        _ => stds_from_none(fit, index) > CERTAIN_STDS,
    };
    // At most 2.3 where nothing acts; beside the usual errors 2.3 for a brake, 2.8 for a tunnel, 0.3 for a form.
    let takes_enough = evidence * reduction > EQUAL;
    let is_sure = if is_by_run {
        // Other differences between runs may follow the measurement: at most 9.6 where nothing acts.
        evidence > OUTSIDE_COST
    } else if is_chosen_among_many(effect) {
        evidence > CERTAIN && takes_enough
    } else {
        evidence > CERTAIN || takes_enough
    };
    let has_runs = fit.runs.len() >= CERTAIN_RUNS_MIN;
    is_sure && !needs_the_score && has_runs && is_shown(fit, index) && runs_agree()
}

/// Whether an effect leaves a force where pieces of the line end: a gradient, or a wheel by which positions are counted
/// between fixes.
pub(super) fn moves_places(effect: &SharedHypothesis) -> bool {
    effect.is_gradient() || effect.nature().changes_speed_scale
}

/// Whether the remainder of what [moves places](moves_places) looks like an effect, whose place was chosen.
pub(super) fn is_left_by_moved_places(effect: &SharedHypothesis) -> bool {
    policy_of(effect.kind()).is_left_by_moved_places && is_chosen_among_many(effect)
}

/// Whether the form, place or run of an effect was chosen among many.
fn is_chosen_among_many(effect: &SharedHypothesis) -> bool {
    policy_of(effect.kind()).is_one_of_many || !effect.ends().is_empty()
}

/// Size of an effect in standard deviations by the scatter between the runs.
fn stds_from_none(fit: &Fit, index: usize) -> f64 {
    let size = fit.model.effects[index].size(fit.effect_parameters(index)).abs();
    size / deviations(fit).std[fit.model.ranges()[index].start]
}

/// Whether an effect shows in enough runs: what has no name must show in several where there are several, for one of
/// them has some form of its own, and the runs agree on what is one number a run, which other numbers of theirs may
/// happen to follow.
fn is_shown(fit: &Fit, index: usize) -> bool {
    let effect = &fit.model.effects[index];
    if fit.runs.len() < CERTAIN_RUNS_MIN {
        true
    } else if effect.nature().is_one_number_a_run {
        stds_from_none(fit, index) > CERTAIN_STDS_BY_RUN
    } else {
        let size = fit.model.ranges()[index].start;
        effect.kind() != EffectKind::Unknown
            || runs_that_show(fit, size) > CERTAIN_RUNS_MIN as f64 - 1.0
    }
}

/// How many runs show a parameter: as many as would with the same information each.
fn runs_that_show(fit: &Fit, parameter: usize) -> f64 {
    let each = fit.runs.iter().map(|run| run.information[(parameter, parameter)]);
    let (sum, squares) =
        each.fold((0.0, 0.0), |(sum, squares), own| (sum + own, squares + own * own));
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

/// Why an effect of a fitted model is not what its kind says.
pub(super) fn contradiction_of(fit: &Fit, index: usize) -> Option<&'static str> {
    fit.model.effects[index].contradiction(fit.effect_parameters(index))
}

/// Whether an effect of a fitted model may be what its kind says.
pub(super) fn may_be(fit: &Fit, index: usize) -> bool {
    contradiction_of(fit, index).is_none() && at_bound(fit, index).is_none()
}
