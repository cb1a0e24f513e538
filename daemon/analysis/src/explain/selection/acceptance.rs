//! Whether what was tried is more than chance, large enough to matter, and seen in the runs.

use super::certainty::{contradiction_of, is_accepted, may_be};
use super::outcome::{Outcome, Trial};
use super::price::at_bound;
use super::search::Search;
use crate::explain::effects::AtBound;

/// A smaller share of the error is what an effect is refused for, a larger one its evidence.
const LITTLE: f64 = 0.2;

/// Why an effect is not accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Its evidence is negative.
    Chance,
    /// It is smaller than what declared figures are good for.
    Immaterial,
    /// A parameter lies at the bound of what is looked for: these data do not hold it.
    AtBound(AtBound),
    /// What was fitted is not what the kind says.
    Contradiction(&'static str),
    /// For its evidence it takes too little from the error, this share of it.
    Weak(f64),
}

impl Refusal {
    /// Whether all but its name speaks for the effect: something is left to explain.
    pub fn leaves_a_residual(&self) -> bool {
        matches!(self, Refusal::AtBound(_) | Refusal::Contradiction(_))
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Refusal::Chance => "explains no more than chance",
            Refusal::Immaterial => "below the accuracy of declared figures",
            Refusal::AtBound(AtBound { name, bound }) => {
                return write!(
                    f,
                    "not identifiable from these data: {name} runs to the bound {bound} of what is \
                     looked for"
                );
            }
            Refusal::Contradiction(why) => return f.write_str(why),
            Refusal::Weak(share) if *share < 0.005 => "takes nothing from the error",
            Refusal::Weak(share) => {
                let why = if *share < LITTLE { ": too little" } else { ", on too little evidence" };
                return write!(f, "takes {:.0} % from the error{why}", 100.0 * share);
            }
        })
    }
}

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
