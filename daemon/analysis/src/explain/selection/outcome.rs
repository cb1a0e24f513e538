//! Trials and results of the search: the price of an effect, the discount on its evidence, and why it is refused.

use std::sync::Arc;

use dynocar_model::terms::masses;
use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::{Cholesky, DMatrix};

use super::deviations::deviations_with_nuisance;
use crate::explain::effects::{AtBound, SharedHypothesis, policy_of};
use crate::explain::evidence::{Fit, acceptance_score};
use crate::statistics::rms;

/// Greatest number of named effects. Small errors of declared figures that many runs make certain are among them.
const EFFECTS_MAX: usize = 6;
/// Number of effects from which a remaining force is no longer looked for without a name: the remainder of four
/// effects, each a little off, has some form in any data.
const FORMLESS_FROM: usize = 4;

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
    pub fn last_parts(&self) -> (SharedHypothesis, Vec<f64>) {
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

    /// Returns whether nothing is left of an effect: the 95 % interval of its size holds zero, of several masses that of
    /// each, and of a dead time and a lag, which take each other's place, that of their sum.
    pub(super) fn holds_none(&self, index: usize) -> bool {
        let range = self.fit.model.ranges()[index].clone();
        let effect = &self.fit.model.effects[index];
        let deviations = deviations_with_nuisance(&self.fit, range.end, self.shared);
        if effect.kind() == EffectKind::MassChange {
            let away = |i: usize| (self.fit.theta[i] - effect.none()).abs();
            return range.into_iter().all(|i| away(i) < HALF_95 * deviations.std[i]);
        }
        if policy_of(effect.kind()).is_late {
            let together_s: f64 = self.fit.theta[range.clone()].iter().sum();
            return together_s < HALF_95 * deviations.std_of_sum(range);
        }
        effect.size(&self.fit.theta[range.clone()]).abs() < HALF_95 * deviations.std[range.start]
    }

    /// Returns whether an effect is no larger than the usual errors of declared figures.
    pub(super) fn is_immaterial(&self, index: usize) -> bool {
        let parameters = self.fit.effect_parameters(index);
        !self.fit.model.effects[index].is_material(parameters, self.fit.theta[2])
    }

    /// Returns whether a change of mass in single runs is the usual scatter of loads: the largest of several deviations
    /// is about √(2 ln n) of their standard deviation, which is the usual one or the larger one that the other runs show.
    pub(super) fn is_as_loads_are(&self, index: usize) -> bool {
        let fit = &self.fit;
        let effect = &fit.model.effects[index];
        if effect.kind() != EffectKind::MassChange {
            return false;
        }
        let range = fit.model.ranges()[index].clone();
        let std = deviations_with_nuisance(fit, range.end, self.shared).std;
        let scatter = fit.noise.scatter.force.max(masses::USUAL_STD);
        let away = range.map(|i| (fit.theta[i] - effect.none()) / std[i].hypot(scatter));
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
    /// Where nothing is named: kinds that are certain and small, but may be none jointly with the usual errors.
    pub(super) small_or_none: Vec<EffectKind>,
    /// Where nothing is named: the values of the small ones jointly with the usual errors.
    pub(super) small_values: Vec<(EffectKind, Vec<f64>)>,
    /// Kinds that are certain jointly with the usual errors, with all trials that were certain when they were found.
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

    /// Returns whether a kind may be added: any, but a force without a name only to a few effects.
    pub(super) fn may_add(&self, kind: EffectKind) -> bool {
        kind != EffectKind::Unknown
            || self.fit.model.effects.len() < FORMLESS_FROM + self.small.len()
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

    /// The values of an effect by its kind: of the model, or of a certain and small one where nothing is named.
    pub fn values(&self, kind: EffectKind) -> Option<&[f64]> {
        let small = || self.small_values.iter().find(|it| it.0 == kind).map(|it| &it.1[..]);
        let position = self.fit.model.position(kind);
        position.map(|index| self.fit.effect_parameters(index)).or_else(small)
    }

    /// Returns the trials of effects that are certain and small, from the round that accepted them.
    pub fn small_trials(&self) -> impl Iterator<Item = &EffectTrial> {
        self.accepted_trials(&self.small)
    }

    /// Returns those of effects that may be none jointly with the usual errors.
    pub fn small_or_none_trials(&self) -> impl Iterator<Item = &EffectTrial> {
        self.accepted_trials(&self.small_or_none)
    }

    fn accepted_trials(&self, kinds: &[EffectKind]) -> impl Iterator<Item = &EffectTrial> {
        let of = |kind: &EffectKind| {
            let rounds = self.rounds.iter().rev().flat_map(|round| round.iter());
            rounds.clone().find(|trial| trial.kind == *kind)
        };
        kinds.iter().filter_map(of)
    }
}

/// Share of the error below which a weak effect is refused for removing too little, above for too little evidence.
const LITTLE: f64 = 0.2;

/// Why an effect is not accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// Its evidence is negative.
    Chance,
    /// It is smaller than the usual errors of declared figures.
    Immaterial,
    /// A parameter lies at a bound of its range: these data do not determine it.
    AtBound(AtBound),
    /// The fitted values contradict the kind.
    Contradiction(&'static str),
    /// It changes the mass of single runs no more than loads usually do, which explains it.
    UsualLoads,
    /// This kind explains more jointly with the usual errors.
    GivesWay(EffectKind),
    /// It removes too little of the error for its evidence, this share of it.
    Weak(f64),
}

impl Refusal {
    /// Returns whether only the kind is in doubt: something is left to explain.
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
            Refusal::Contradiction(why) => why,
            Refusal::UsualLoads => {
                "its runs stand out from the others no more than the largest of as many loads do"
            }
            Refusal::GivesWay(kind) => {
                return write!(f, "{} and the usual errors explain more", kind.name());
            }
            Refusal::Weak(share) if *share < 0.005 => "takes nothing from the error",
            Refusal::Weak(share) => {
                let why = if *share < LITTLE { ": too little" } else { ", on too little evidence" };
                return write!(f, "takes {:.0} % from the error{why}", 100.0 * share);
            }
        })
    }
}

/// Returns the price of an effect of a fitted model in -2 log likelihood. Each parameter costs the logarithm of the
/// number of observations (Schwarz 1978), each choice of a structure twice the logarithm of the number of structures.
/// For an effect that depends on one number per run, a run is one observation. Parameters with a prior of their own
/// cost the log determinant by which the data narrow them (Laplace's approximation of the evidence; Rasmussen and
/// Williams 2006, equation 3.32).
pub fn penalty(fit: &Fit, index: usize) -> f64 {
    let effect = &fit.model.effects[index];
    let narrowed = effect.nature().prior.and_then(|prior| narrowed(fit, index, prior));
    let by_count = || {
        let parameters = effect.parameters().len() as f64;
        let observations =
            if effect.nature().is_one_number_a_run { fit.runs.len() } else { fit.observations() };
        parameters * (observations.max(2) as f64).ln()
    };
    narrowed.unwrap_or_else(by_count) + effect.nature().choice_cost
}

/// Returns the logarithm of the determinant of the information about an effect's parameters, all others fitted, over
/// that of the prior; `None` when one of them is singular.
fn narrowed(fit: &Fit, index: usize, prior: &DMatrix<f64>) -> Option<f64> {
    let own = fit.model.ranges()[index].clone();
    let information = fit.information();
    let others: Vec<usize> = (0..fit.theta.len()).filter(|i| !own.contains(i)).collect();
    let rest = information.select_rows(&others).select_columns(&others);
    let log_determinant =
        |matrix: DMatrix<f64>| Some(2.0 * Cholesky::new(matrix)?.l().diagonal().map(f64::ln).sum());
    let all = log_determinant(information)?;
    Some(all - log_determinant(rest)? - log_determinant(prior.clone())?)
}

/// Returns the decrease of -2 log likelihood by an effect of a fitted model, less the decrease that errors shared by
/// all runs would bring: (x/s)² becomes x²/(s² + e²), for each parameter.
pub fn discounted(fit: &Fit, index: usize, decrease: f64) -> f64 {
    let effect = &fit.model.effects[index];
    let shared = effect.nature().shared_error;
    if shared == 0.0 || decrease <= 0.0 {
        return decrease;
    }
    let parameters = fit.effect_parameters(index);
    let each = decrease / parameters.len() as f64;
    decrease / (1.0 + each * (shared / effect.size(parameters)).powi(2))
}

/// Returns the parameter of effect number `index` that lies at a bound of its range.
pub fn at_bound(fit: &Fit, index: usize) -> Option<AtBound> {
    fit.model.effects[index].at_bound(fit.effect_parameters(index))
}

/// The price of all effects of a model.
pub fn model_penalty(fit: &Fit) -> f64 {
    (0..fit.model.effects.len()).map(|index| penalty(fit, index)).sum()
}
