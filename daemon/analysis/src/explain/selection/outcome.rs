//! Trials and results of the search.

use std::sync::Arc;

use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;

use super::acceptance::Refusal;
use super::by_run::deviations_with_nuisance;
use crate::explain::effects::SharedHypothesis;
use crate::explain::evidence::{Fit, acceptance_score};
use crate::statistics::rms;

/// Greatest number of named effects.
const EFFECTS_MAX: usize = 4;

/// One candidate, fitted together with everything accepted so far.
#[derive(Clone)]
pub struct EffectTrial {
    /// Its kind.
    pub kind: EffectKind,
    /// The fitted model; the candidate is its last effect.
    pub fit: Fit,
    /// Decrease of -2 log likelihood by the candidate, less its price; kinds are compared by it.
    pub bic_gain: f64,
    /// The same after the discount for errors that all runs share; it must be more than chance.
    pub evidence: f64,
    /// Share of the open-loop error that it removes: the smaller of that over the fit runs as fitted, and that over
    /// each run as predicted from the others; 0 where the evidence does not ask for it.
    pub reduction: f64,
    /// Whether its kind has this one structure only, independent of the remaining residual.
    pub is_only: bool,
}

impl EffectTrial {
    /// The number of the candidate among the effects of its model.
    pub fn last(&self) -> usize {
        self.fit.model.effects.len() - 1
    }

    /// The candidate and its parameters.
    pub(super) fn last_parts(&self) -> (SharedHypothesis, Vec<f64>) {
        let last = self.last();
        (self.fit.model.effects[last].clone(), self.fit.effect_parameters(last).to_vec())
    }

    /// Returns the score that decides.
    pub fn acceptance_score(&self) -> f64 {
        acceptance_score(self.evidence, self.reduction)
    }
}

/// The best trial of each kind, the strongest first.
pub type SearchRound = Arc<[EffectTrial]>;

/// A round to remember: how good the trials were, and no more by observation.
pub(super) fn round_of(mut trials: Vec<EffectTrial>) -> SearchRound {
    trials.iter_mut().for_each(|trial| trial.fit.forget_series());
    trials.into()
}

/// A model fitted jointly with the usual errors.
#[derive(Clone)]
pub struct NuisanceFit {
    /// The fit: the usual errors are its last effects, and loads and winds of the runs are integrated out.
    pub fit: Fit,
    /// Number of the last parameters that all runs share.
    pub shared: usize,
}

impl NuisanceFit {
    /// Returns whether it belongs to a fitted model with the parameters `from`.
    pub(super) fn is_of(&self, fit: &Fit, from: &[f64]) -> bool {
        let mut effects = fit.model.effects.iter().zip(&self.fit.model.effects);
        fit.theta == from && effects.all(|(one, other)| Arc::ptr_eq(one, other))
    }

    /// Returns whether nothing is left of an effect: the 95 % interval of its size holds zero.
    pub(super) fn holds_none(&self, index: usize) -> bool {
        let range = self.fit.model.ranges()[index].clone();
        let size = self.fit.model.effects[index].size(&self.fit.theta[range.clone()]);
        let std = deviations_with_nuisance(&self.fit, range.end, self.shared).std[range.start];
        size.abs() < HALF_95 * std
    }

    /// Returns whether a change of mass in single runs is the usual scatter of loads: the largest of several deviations
    /// is about √(2 ln n) of their standard deviation, which the other runs show.
    pub(super) fn is_as_loads_are(&self, index: usize) -> bool {
        let fit = &self.fit;
        let effect = &fit.model.effects[index];
        if effect.kind() != EffectKind::MassChange {
            return false;
        }
        let range = fit.model.ranges()[index].clone();
        let std = deviations_with_nuisance(fit, range.end, self.shared).std;
        let away =
            range.map(|i| (fit.theta[i] - effect.none()) / std[i].hypot(fit.noise.scatter.force));
        rms(&away.collect::<Vec<_>>()) < (2.0 * (fit.runs.len() as f64).ln()).sqrt()
    }
}

/// Result of the search.
#[derive(Clone)]
pub struct SearchOutcome {
    /// The declared model with a, b, c refitted.
    pub base: Fit,
    /// The model with all accepted effects.
    pub fit: Fit,
    /// The model at its greatest likelihood, before the joint fit with the usual errors moved it: the standard
    /// deviations come from it.
    pub likeliest: Fit,
    /// The rounds; the last is the one in which nothing more was accepted.
    pub rounds: Vec<SearchRound>,
    /// Where several effects were found, the trials in the place of each.
    pub instead: Vec<(EffectKind, SearchRound)>,
    /// Kinds that the data do not allow to test, and why.
    pub not_testable: Vec<(EffectKind, String)>,
    /// Kinds that are certain and small: part of the model, and not named.
    pub small: Vec<EffectKind>,
    /// Kinds that are certain jointly with the usual errors, with the trials of the round that found them.
    pub certain: Vec<(EffectKind, SearchRound)>,
    /// Kinds that were found and did not stand jointly with the usual errors, and why; they are not looked for again.
    pub fallen: Vec<(EffectKind, Refusal)>,
    /// Kinds at chosen places that were tried as one number of the whole train or line.
    pub(super) returned: Vec<EffectKind>,
    /// Parameters of the model that was last fitted jointly with the usual errors, and that joint fit.
    pub(super) nuisance_fit: Option<(Vec<f64>, Arc<NuisanceFit>)>,
}

impl SearchOutcome {
    /// Returns whether an effect of the model is named: it is more than a small, certain error of a declared figure.
    pub fn is_named(&self, kind: EffectKind) -> bool {
        !self.small.contains(&kind)
    }

    /// The kinds of the model's effects.
    pub(super) fn kinds(&self) -> Vec<EffectKind> {
        self.fit.model.effects.iter().map(|effect| effect.kind()).collect()
    }

    /// Returns the finished model jointly with the usual errors; `None` where it was not fitted so.
    pub fn nuisance_fit(&self) -> Option<Arc<NuisanceFit>> {
        self.nuisance_fit.as_ref().map(|(_, joint)| joint.clone())
    }

    /// Puts another fit with the usual errors in the place of that.
    pub fn set_nuisance_fit(&mut self, joint: NuisanceFit) {
        self.nuisance_fit = Some((self.likeliest.theta.clone(), joint.into()));
    }

    /// Returns whether nothing more is looked for.
    pub(super) fn is_full(&self) -> bool {
        self.fit.model.effects.len() >= EFFECTS_MAX + self.small.len()
    }

    /// Returns whether an effect of the model may be removed or replaced by another kind.
    pub(super) fn is_on_trial(&self, kind: EffectKind) -> bool {
        self.is_named(kind) && !self.is_certain(kind)
    }

    /// Returns whether an effect of the model is certain jointly with the usual errors, however little of the error it
    /// removes.
    pub fn is_certain(&self, kind: EffectKind) -> bool {
        self.certain.iter().any(|(certain, _)| *certain == kind)
    }

    /// Returns the kinds that are not looked for again.
    pub(super) fn fallen_kinds(&self) -> Vec<EffectKind> {
        self.fallen.iter().map(|(kind, _)| *kind).collect()
    }

    /// The values of an effect of the model by its kind.
    pub fn values(&self, kind: EffectKind) -> Option<&[f64]> {
        Some(self.fit.effect_parameters(self.fit.model.position(kind)?))
    }

    /// Returns the trials of effects that are certain and small, from the round that accepted them.
    pub fn small_trials(&self) -> impl Iterator<Item = &EffectTrial> {
        let of = |kind: &EffectKind| {
            let rounds = self.rounds.iter().rev().flat_map(|round| round.iter());
            rounds.clone().find(|trial| trial.kind == *kind)
        };
        self.small.iter().filter_map(of)
    }
}
