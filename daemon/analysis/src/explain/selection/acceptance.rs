//! Whether what was tried is more than chance, large enough to matter, and seen in the runs.

use super::certainty::{contradiction_of, is_accepted, may_be};
use super::outcome::{Outcome, Trial};
use super::price::at_bound;
use super::refusal::Refusal;
use super::search::Search;

impl Search<'_> {
    /// Why the last effect of a trial is not accepted; `None` when it is.
    pub fn refusal(trial: &Trial) -> Option<Refusal> {
        if trial.evidence <= 0.0 {
            Some(Refusal::Chance)
        } else if !is_material(trial) {
            Some(Refusal::Immaterial)
        } else if !is_accepted(&trial.fit, trial.last(), trial.evidence, trial.reduction) {
            Some(Refusal::Weak(trial.reduction))
        } else {
            contradiction(trial)
                .map(Refusal::Contradiction)
                .or_else(|| at_bound(&trial.fit, trial.last()).map(Refusal::AtBound))
        }
    }

    /// The greatest strength of the trials of the first round that only their strength may refuse:
    /// what is compared with its distribution where nothing acts.
    pub fn greatest_score(outcome: &Outcome) -> f64 {
        let first = outcome.rounds.first().into_iter().flat_map(|round| round.iter());
        first
            .filter(|trial| is_material(trial) && is_possible(trial))
            .map(Trial::acceptance_score)
            .fold(0.0, f64::max)
    }
}

/// Whether the last effect of a trial is larger than what declared figures are good for.
pub(super) fn is_material(trial: &Trial) -> bool {
    let last = trial.last();
    let parameters = trial.fit.effect_parameters(last);
    trial.fit.model.effects[last].is_material(parameters, trial.fit.theta[2])
}

/// Whether the last effect of a trial may be what its kind says.
pub(super) fn is_possible(trial: &Trial) -> bool {
    may_be(&trial.fit, trial.last())
}

/// Why the last effect of a trial is not what its kind says.
fn contradiction(trial: &Trial) -> Option<&'static str> {
    contradiction_of(&trial.fit, trial.last())
}
