//! Whether what was tried is more than chance, large enough to matter, and seen in the runs.

use dynocar_shared::vocabulary::EffectKind;

use super::by_run::leave_one_run_out;
use super::search::{Outcome, Search, Trial};
use super::significance::{EVIDENCE_MIN, REDUCTION_MIN, STRENGTH_MIN, at_bound};
use crate::explain::effects::AtBound;
use crate::explain::evidence::Fit;

/// What is beyond any doubt need take away only this share.
const SMALL_REDUCTION_MIN: f64 = 0.06;
/// Strength beyond any doubt.
const CERTAIN_STRENGTH: f64 = 30.0;
/// A further one, or one outside the library that is not beyond doubt, this share of what the
/// others leave.
const FURTHER_REDUCTION_MIN: f64 = 0.15;

/// Why an effect is not accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Its evidence is negative.
    Chance,
    /// Its evidence is less than a search over the whole library brings by itself.
    Insignificant,
    /// It is smaller than what declared figures are good for.
    Immaterial,
    /// A parameter lies at the bound of what is looked for: these data do not hold it.
    AtBound(AtBound),
    /// What was fitted is not what the kind says.
    Contradiction(&'static str),
    /// It takes away this share of the open-loop error, which is too little.
    LittleOfTheError(f64),
    /// Evidence and share of the error are too small together.
    Weak,
    /// Runs left out of the fit do not gain from it.
    NotInEveryRun,
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
            Refusal::Insignificant => "not significant for a search over the whole library",
            Refusal::Immaterial => "smaller than what declared figures are good for",
            Refusal::AtBound(AtBound { name, bound }) => {
                return write!(
                    f,
                    "not identifiable from these data: {name} runs to the bound {bound} of what is \
                     looked for"
                );
            }
            Refusal::Contradiction(why) => return f.write_str(why),
            Refusal::LittleOfTheError(share) if *share < 0.005 => {
                return f.write_str("takes nothing from the error");
            }
            Refusal::LittleOfTheError(share) => {
                return write!(f, "takes only {:.0} % from the error", 100.0 * share);
            }
            Refusal::Weak => "takes too little from the error for its evidence",
            Refusal::NotInEveryRun => "runs left out of the fit do not gain from it",
        })
    }
}

impl Search<'_> {
    /// Why the last effect of a trial is not accepted; `None` when it is.
    pub fn refusal(&self, base: &Fit, trial: &Trial) -> Option<Refusal> {
        if trial.evidence <= 0.0 {
            Some(Refusal::Chance)
        } else if trial.evidence <= EVIDENCE_MIN {
            Some(Refusal::Insignificant)
        } else if !is_material(trial) {
            Some(Refusal::Immaterial)
        } else if trial.reduction <= reduction_min(trial) {
            Some(Refusal::LittleOfTheError(trial.reduction))
        } else if trial.strength() <= STRENGTH_MIN {
            Some(Refusal::Weak)
        } else if !self.holds_by_run(base, trial) {
            Some(Refusal::NotInEveryRun)
        } else {
            contradiction(trial)
                .map(Refusal::Contradiction)
                .or_else(|| at_bound(&trial.fit, trial.last()).map(Refusal::AtBound))
        }
    }

    /// The greatest strength of the trials of the first round that only their strength may refuse:
    /// what is compared with its distribution where nothing acts.
    pub fn greatest_strength(&self, outcome: &Outcome) -> f64 {
        let first = outcome.rounds.first().into_iter().flatten();
        first
            .filter(|trial| {
                trial.evidence > EVIDENCE_MIN
                    && is_material(trial)
                    && contradiction(trial).is_none()
                    && at_bound(&trial.fit, trial.last()).is_none()
                    && self.holds_by_run(&outcome.base, trial)
            })
            .map(Trial::strength)
            .fold(0.0, f64::max)
    }

    /// For what is not chosen run by run, the runs that took no part in the fit must gain too.
    fn holds_by_run(&self, base: &Fit, trial: &Trial) -> bool {
        let sharper = self.problem.fit(&base.model, base.theta.clone(), trial.fit.noise);
        let held = leave_one_run_out(&sharper, &trial.fit);
        if trial.fit.model.effects[trial.last()].is_event() || held.runs < 3 {
            return true;
        }
        held.gain > 0.5 * EVIDENCE_MIN && 2 * held.better > held.runs
    }
}

/// Whether the last effect of a trial is larger than what declared figures are good for.
fn is_material(trial: &Trial) -> bool {
    let last = trial.last();
    let parameters = trial.fit.effect_parameters(last);
    trial.fit.model.effects[last].is_material(parameters, trial.fit.theta[2])
}

/// Why the last effect of a trial is not what its kind says.
fn contradiction(trial: &Trial) -> Option<&'static str> {
    let last = trial.last();
    trial.fit.model.effects[last].contradiction(trial.fit.effect_parameters(last))
}

/// What the last effect of a trial must take away.
fn reduction_min(trial: &Trial) -> f64 {
    let is_first = trial.fit.model.effects.len() == 1;
    let is_certain = trial.strength() > CERTAIN_STRENGTH;
    match (is_first, is_certain) {
        (true, true) => SMALL_REDUCTION_MIN,
        (true, false) if trial.kind != EffectKind::Unknown => REDUCTION_MIN,
        _ => FURTHER_REDUCTION_MIN,
    }
}
