//! Whether a trial is more than chance, large enough to matter, and seen in the runs. An effect is accepted because it
//! removes much of the error for its evidence, or because it is certain; a refusal states its reason.

use dynocar_model::terms::delay;
use dynocar_shared::vocabulary::EffectKind;

use super::deviations::{deviations, scatter_factor};
use super::outcome::{EffectTrial, Refusal, SearchOutcome, at_bound, penalty};
use super::search::Search;
use crate::explain::effects::{Certainty, SharedHypothesis, policy_of};
use crate::explain::evidence::{
    CERTAIN_STDS, CERTAIN_STDS_BY_RUN, EQUAL, Fit, OUTSIDE_COST, SCORE_MIN, acceptance_score,
};

impl Search<'_> {
    /// Returns why the last effect of a trial is not accepted; `None` when it is.
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

    /// Returns the greatest acceptance score of the trials of the first round that only this score may refuse, to be
    /// compared with its distribution where nothing acts.
    pub fn greatest_score(outcome: &SearchOutcome) -> f64 {
        let first = outcome.rounds.first().into_iter().flat_map(|round| round.iter());
        first
            .filter(|trial| is_material(trial) && is_possible(trial))
            .map(EffectTrial::acceptance_score)
            .fold(0.0, f64::max)
    }
}

/// Returns whether the last effect of a trial is larger than the usual errors of declared figures.
pub(super) fn is_material(trial: &EffectTrial) -> bool {
    let last = trial.last();
    let parameters = trial.fit.effect_parameters(last);
    trial.fit.model.effects[last].is_material(parameters, trial.fit.theta[2])
}

/// Returns whether the parameters of the last effect of a trial are possible for its kind.
pub(super) fn is_possible(trial: &EffectTrial) -> bool {
    may_be(&trial.fit, trial.last())
}

/// Evidence above which one number of the whole train or line is certain. Where nothing acts the evidence is at most 2;
/// where all declared figures have small errors, at most 26 for an effect that is absent, and 8 jointly with the usual
/// errors.
pub(super) const CERTAIN: f64 = 30.0;
/// Least number of runs that can agree on an effect.
pub(super) const CERTAIN_RUNS_MIN: usize = 3;

/// Returns whether an effect of a fitted model is more than chance and more than the usual errors of declared figures
/// explain: it removes much of the error for its evidence, or is certain.
pub(super) fn is_accepted(fit: &Fit, index: usize, evidence: f64, reduction: f64) -> bool {
    acceptance_score(evidence, reduction) > SCORE_MIN && is_shown(fit, index)
        || is_certain(fit, index, evidence, reduction, false)
}

/// Returns the score that decided for an effect of a fitted model: its acceptance score, or the least that accepts
/// where it was accepted because it is certain, in this fit or jointly with the usual errors.
pub fn deciding_score(
    fit: &Fit,
    index: usize,
    (evidence, reduction): (f64, f64),
    is_certain_with_nuisance: bool,
) -> f64 {
    let score = acceptance_score(evidence, reduction);
    let is_certain = is_certain_with_nuisance || is_certain(fit, index, evidence, reduction, false);
    if is_certain { score.max(SCORE_MIN) } else { score }
}

/// Returns whether an effect is certain, however little of the error it removes: the runs agree on one number of the
/// whole train or line with strong evidence, or with less evidence where it removes more. An effect that was chosen
/// among many must remove more of the error. The [policy](policy_of) of a kind states where it may be certain at all.
pub(super) fn is_certain(
    fit: &Fit,
    index: usize,
    evidence: f64,
    reduction: f64,
    has_nuisance: bool,
) -> bool {
    let effect = &fit.model.effects[index];
    let policy = policy_of(effect.kind());
    let is_by_run = effect.nature().is_one_number_a_run;
    let may_be_certain = match policy.certainty {
        Certainty::Anywhere => true,
        Certainty::WithNuisance => has_nuisance,
        Certainty::Never => false,
    };
    let is_doubtful = policy.uncertain_with.iter().any(|kind| fit.model.has(*kind));
    // The usual errors include the map's.
    let is_left = !has_nuisance
        && is_left_by_moved_places(effect)
        && fit.model.effects.iter().any(moves_places);
    let needs_the_score = !may_be_certain || is_doubtful || is_left;
    // The size of a form depends on its shape, its gain does not.
    let runs_agree = || match effect.kind() {
        EffectKind::Unknown => {
            let size = fit.model.ranges()[index].start;
            let gain = (evidence + penalty(fit, index)).max(0.0);
            gain.sqrt() > CERTAIN_STDS * scatter_factor(fit, size)
        }
        // `is_shown` asks for it.
        _ if is_by_run => true,
        _ => stds_from_none(fit, index) > CERTAIN_STDS,
    };
    // At most 2.3 where nothing acts; jointly with the usual errors 2.3 for a brake, 2.8 for a tunnel, 0.3 for a form.
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

/// Returns whether an effect leaves a force where pieces of the line end: a gradient, or a wheel by which positions are
/// counted between fixes.
pub(super) fn moves_places(effect: &SharedHypothesis) -> bool {
    effect.is_gradient() || effect.nature().changes_speed_scale
}

/// Returns whether the chosen place of an effect may only be the remainder of another effect that [moves
/// places](moves_places).
pub(super) fn is_left_by_moved_places(effect: &SharedHypothesis) -> bool {
    policy_of(effect.kind()).is_left_by_moved_places && is_chosen_among_many(effect)
}

/// Returns whether the form, place or run of an effect was chosen among many.
fn is_chosen_among_many(effect: &SharedHypothesis) -> bool {
    policy_of(effect.kind()).is_one_of_many || !effect.ends().is_empty()
}

/// Size of an effect in standard deviations by the scatter between the runs. A dead time and a lag take each other's
/// place: for a late brake both together count, beyond the usual lateness.
fn stds_from_none(fit: &Fit, index: usize) -> f64 {
    let (effect, parameters) = (&fit.model.effects[index], fit.effect_parameters(index));
    let range = fit.model.ranges()[index].clone();
    let deviations = deviations(fit);
    if effect.kind() == EffectKind::BrakeDelay {
        let beyond_s = parameters.iter().sum::<f64>() - delay::LEAST_S;
        return beyond_s / deviations.std_of_sum(range);
    }
    effect.size(parameters).abs() / deviations.std[range.start]
}

/// Returns whether an effect shows in enough runs. A form without a name must show in several runs where there are
/// several, since some form fits one of them. An effect that depends on one number per run must differ clearly from no
/// effect, since other numbers of the runs may follow that number by chance.
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

/// Returns why the parameters of an effect are impossible for its kind.
pub(super) fn contradiction_of(fit: &Fit, index: usize) -> Option<&'static str> {
    fit.model.effects[index].contradiction(fit.effect_parameters(index))
}

/// Returns whether the parameters of an effect are possible for its kind.
pub(super) fn may_be(fit: &Fit, index: usize) -> bool {
    contradiction_of(fit, index).is_none() && at_bound(fit, index).is_none()
}
