//! Forward search with a swap pass and pruning.

use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::vocabulary::EffectKind;
use rayon::prelude::*;

use super::certainty::{is_accepted, may_be};
use super::outcome::{Outcome, Round, Trial};
use super::price::{discounted, model_penalty, penalty};
use super::steps::{Progress, Steps, round_share};
use crate::explain::effects::{Candidate, Effect, LIBRARY, Proposal, UNKNOWN};
use crate::explain::evidence::{EQUAL, Fit, FitProblem, Noise, RunData, UpdatedModel};
use crate::explain::scan::Scan;
use crate::explain::score::{FitErrors, reduction};

/// Named effects at most, and rounds: what is taken in and dropped again must come to an end.
const EFFECTS_MAX: usize = 4;
const ROUNDS_MAX: usize = 10;
/// Kinds that get a noise of their own and a second localisation in each round.
const FINALISTS: usize = 5;
/// A finalist's advantage: not far below none, and no less than this share of the greatest.
const FINALIST_MIN: f64 = -20.0;
const FINALIST_SHARE: f64 = 0.1;
/// Kinds that take away this share of the open-loop error come before the others, and are all that is
/// looked at again beyond this number of observations, where small things are significant.
const FINALIST_ERROR_REDUCTION: f64 = 0.02;
const MANY_OBSERVATIONS: usize = 5_000;
/// Shares of the slow part of a noise under which a kind looks again.
pub(super) const STIFF: [f64; 2] = [0.01, 1e-4];
/// Less observations than this show nothing.
pub const OBSERVATIONS_MIN: usize = 80;

/// The search over one dataset.
pub struct Search<'a> {
    /// The fit runs.
    pub problem: &'a FitProblem,
    /// Runs whose speeds are not looked at.
    pub holdout: &'a [RunData],
    /// The declared train.
    pub train: &'a TrainModel,
    /// The declared line.
    pub track: Option<&'a Arc<Track>>,
    /// Told how far the search is.
    pub progress: Progress<'a>,
}

/// What trying a kind brought.
enum Tried<'e> {
    /// The data do not allow to test it, and why.
    NotTestable(EffectKind, String),
    /// Its best candidate, if any, by this kind or its forms.
    Best(Option<Box<Trial>>, &'e dyn Effect),
}

impl<'e> Tried<'e> {
    /// Among the trials, or what cannot be tested.
    fn take(
        self,
        trials: &mut Vec<(Trial, &'e dyn Effect)>,
        not_testable: &mut Vec<(EffectKind, String)>,
    ) {
        match self {
            Tried::Best(best, effect) => trials.extend(best.map(|trial| (*trial, effect))),
            Tried::NotTestable(kind, reason) => {
                if !not_testable.iter().any(|(other, _)| *other == kind) {
                    not_testable.push((kind, reason));
                }
            }
        }
    }
}

impl Search<'_> {
    /// The declared model with a, b, c refitted, and no search for effects.
    pub fn base(&self) -> Outcome {
        (self.progress)(0.05, "fitting a, b, c");
        let declared = UpdatedModel::default();
        let start = self.problem.start(&[]);
        let first = self.problem.fit_with_noise(&declared, start, Noise::START);
        let base = self.problem.with_own_noise(&first);
        Outcome {
            base: base.clone(),
            likeliest: base.clone(),
            fit: base,
            rounds: Vec::new(),
            instead: Vec::new(),
            not_testable: Vec::new(),
            small: Vec::new(),
        }
    }

    /// Searches.
    pub fn run(&self) -> Outcome {
        let mut outcome = self.base();
        if outcome.base.observations() < OBSERVATIONS_MIN {
            return outcome;
        }
        while outcome.fit.model.effects.len() < EFFECTS_MAX + outcome.small.len()
            && outcome.rounds.len() < ROUNDS_MAX
        {
            let trials = self.round(&outcome.fit, &mut outcome.not_testable);
            let next = self.best(&trials).map(|trial| trial.fit.clone());
            let small = Self::certain_and_small(&trials).filter(|_| next.is_none());
            let small = small.map(|trial| (trial.kind, trial.fit.clone()));
            let round = Round::from(trials);
            outcome.rounds.push(round.clone());
            if let Some((kind, fit)) = small {
                outcome.small.push(kind);
                outcome.fit = fit;
                continue;
            }
            let Some(next) = next else { break };
            outcome.fit = next;
            if outcome.fit.model.effects.len() > 1 {
                (self.progress)(round_share(outcome.rounds.len(), 0.0), "swapping effects");
                outcome.instead = self.swap(&mut outcome.fit, &outcome.small, round);
                self.prune(&mut outcome.fit, &outcome.small);
            }
        }
        self.name_or_forget_small(&mut outcome);
        outcome
    }

    /// The trial to accept: the one with the strongest evidence, or one with about the same that
    /// takes away more of the open-loop error. What is outside the library must explain more than
    /// anything in it.
    fn best<'t>(&self, trials: &'t [Trial]) -> Option<&'t Trial> {
        let accepted: Vec<&Trial> =
            trials.iter().filter(|trial| Self::refusal(trial).is_none()).collect();
        let strongest = accepted.first()?;
        accepted
            .iter()
            .take_while(|trial| trial.bic_gain > strongest.bic_gain - EQUAL)
            .filter(|trial| trial.kind != EffectKind::Unknown)
            .max_by(|one, other| one.reduction.total_cmp(&other.reduction))
            .or(Some(strongest))
            .copied()
    }

    /// Tries every kind that the model does not have yet; the strongest first.
    fn round(&self, base: &Fit, not_testable: &mut Vec<(EffectKind, String)>) -> Vec<Trial> {
        let Some(scan) = self.scan(base) else { return Vec::new() };
        let steps = Steps::of(self.progress, base.model.effects.len(), LIBRARY.len() + FINALISTS);
        let mut trials = self.try_all(base, &scan, &steps, not_testable);
        let by_advantage = |one: &Trial, other: &Trial| other.bic_gain.total_cmp(&one.bic_gain);
        let before = FitErrors::of(self.problem, base);
        let reduction = |fit: &Fit| FitErrors::of(self.problem, fit).reduction_from(&before);
        trials
            .par_iter_mut()
            .filter(|(trial, _)| trial.bic_gain > FINALIST_MIN)
            .for_each(|(trial, _)| trial.reduction = reduction(&trial.fit));
        // What takes nothing from the error comes last, and is no measure for the others.
        let helps = |trial: &Trial| trial.reduction > FINALIST_ERROR_REDUCTION;
        let key = |trial: &Trial| (helps(trial), trial.bic_gain);
        trials.sort_by(|(one, _), (other, _)| {
            let (one, other) = (key(one), key(other));
            other.0.cmp(&one.0).then(other.1.total_cmp(&one.1))
        });
        let greatest = trials.first().map_or(0.0, |(trial, _)| trial.bic_gain);
        let least = FINALIST_MIN.max(FINALIST_SHARE * greatest);
        let is_long = base.observations() > MANY_OBSERVATIONS;
        let mut finished: Vec<Trial> = trials
            .into_par_iter()
            .enumerate()
            .map(|(rank, (trial, effect))| {
                let is_finalist =
                    rank < FINALISTS && trial.bic_gain > least && (helps(&trial) || !is_long);
                if !is_finalist {
                    return trial;
                }
                let trial = steps.done_with(effect, |effect| self.finalist(base, trial, effect));
                Trial { reduction: reduction(&trial.fit), ..trial }
            })
            .collect();
        finished.sort_by(by_advantage);
        finished
    }

    /// Tries every kind that the model does not have yet, what is outside the library last.
    fn try_all<'e>(
        &self,
        base: &Fit,
        scan: &Scan,
        steps: &Steps,
        not_testable: &mut Vec<(EffectKind, String)>,
    ) -> Vec<(Trial, &'e dyn Effect)> {
        let is_new = |effect: &&dyn Effect| {
            !base.model.effects.iter().any(|own| own.kind() == effect.kind())
        };
        let (outside, library): (Vec<&dyn Effect>, Vec<&dyn Effect>) =
            LIBRARY.into_iter().filter(is_new).partition(|it| it.kind() == EffectKind::Unknown);
        let try_kind = |effect| steps.done_with(effect, |effect| self.try_kind(base, scan, effect));
        let tried: Vec<Tried> = library.into_par_iter().map(try_kind).collect();
        let mut trials = Vec::new();
        tried.into_iter().for_each(|tried| tried.take(&mut trials, not_testable));
        let mut has_forms = false;
        for effect in outside {
            has_forms = self.asks_for_a_form(scan, &trials);
            try_kind(if has_forms { UNKNOWN } else { effect }).take(&mut trials, not_testable);
        }
        if !has_forms {
            self.take_form_that_noise_holds(base, &mut trials);
        }
        trials
    }

    /// The best candidate of a kind, beside everything accepted so far.
    fn try_kind<'e>(&self, base: &Fit, scan: &Scan, effect: &'e dyn Effect) -> Tried<'e> {
        match effect.propose(scan) {
            Proposal::NotTestable(reason) => Tried::NotTestable(effect.kind(), reason),
            Proposal::Candidates(candidates) => {
                let best = self.best_attempt(base, base, candidates);
                Tried::Best(best.map(Box::new), effect)
            }
        }
    }

    /// The candidate that explains most for its price, fitted on top of a fit.
    fn best_attempt(&self, base: &Fit, onto: &Fit, candidates: Vec<Candidate>) -> Option<Trial> {
        let attempts: Vec<Trial> = candidates
            .into_par_iter()
            .map(|candidate| self.attempt(base, onto, candidate))
            .collect();
        attempts.into_iter().max_by(|one, other| one.bic_gain.total_cmp(&other.bic_gain))
    }

    /// A scan around a fit; `None` when the fit's information is singular.
    pub fn scan<'s>(&'s self, fit: &'s Fit) -> Option<Scan<'s>> {
        Scan::new(self.problem, self.holdout, self.train, self.track, fit)
    }

    /// Fits a candidate on top of a fit; its evidence counts against `base`.
    fn attempt(&self, base: &Fit, onto: &Fit, candidate: Candidate) -> Trial {
        let kind = candidate.hypothesis.kind();
        let fit = self.problem.grown(onto, [candidate.parts()]);
        Self::trial(base, fit, kind)
    }

    fn trial(base: &Fit, fit: Fit, kind: EffectKind) -> Trial {
        let decrease = base.cost - fit.cost;
        let last = fit.model.effects.len() - 1;
        let price = penalty(&fit, last);
        let evidence = discounted(&fit, last, decrease) - price;
        Trial { kind, fit, bic_gain: decrease - price, evidence, reduction: 0.0 }
    }

    /// Gives a trial the noise that remains under it and lets its kind look again for places and windows
    /// under that noise: the noise of the smaller model holds the effect itself. Where there are many to
    /// choose from, it looks under stiff noises too.
    fn finalist(&self, base: &Fit, trial: Trial, effect: &dyn Effect) -> Trial {
        let mut best = Self::trial(base, self.problem.with_own_noise(&trial.fit), trial.kind);
        for attempt in 0..3 {
            let own = best.fit.noise;
            let look = |noise: Noise| self.look_again(base, noise, effect);
            let (again, many) =
                look(own).map_or((None, false), |(trial, many)| (Some(trial), many));
            let shares = if attempt == 0 && many { &STIFF[..] } else { &[] };
            let stiff: Vec<_> =
                shares.par_iter().filter_map(|share| look(own.stiff(*share))).collect();
            let mut is_better = false;
            for again in again.into_iter().chain(stiff.into_iter().map(|it| it.0)) {
                if again.bic_gain > best.bic_gain + 1.0 {
                    best = again;
                    is_better = true;
                }
            }
            if !is_better {
                break;
            }
        }
        best
    }

    /// The best candidate of a kind when it looks for places and windows under a given noise, and whether
    /// there are many to choose from.
    pub(super) fn look_again(
        &self,
        base: &Fit,
        noise: Noise,
        effect: &dyn Effect,
    ) -> Option<(Trial, bool)> {
        let onto = self.problem.again(base, noise);
        let scan = self.scan(&onto)?;
        let Proposal::Candidates(candidates) = effect.propose(&scan) else { return None };
        let many = candidates.len() > 1 || candidates.iter().any(Candidate::is_chosen_among_many);
        let best = self.best_attempt(base, &onto, candidates)?;
        Some((Self::trial(base, self.problem.with_own_noise(&best.fit), best.kind), many))
    }

    /// Total cost of a model: fit and price.
    pub(super) fn total(fit: &Fit) -> f64 {
        fit.cost + model_penalty(fit)
    }

    /// Takes each effect out in turn and looks whether another kind does better in its place; what was
    /// tried in the place of each kind that stands after it: of the last, while the others stay, in the round
    /// that brought it.
    fn swap(
        &self,
        fit: &mut Fit,
        small: &[EffectKind],
        brought_last: Round,
    ) -> Vec<(EffectKind, Round)> {
        let mut tried = Vec::new();
        let last = fit.model.effects.len() - 1;
        let mut others_stay = true;
        for index in 0..=last {
            if index == last && others_stay {
                tried.push((fit.model.effects[last].kind(), brought_last));
                break;
            }
            if small.contains(&fit.model.effects[index].kind()) {
                continue;
            }
            let rest = self.without(fit, index);
            let trials = self.round(&rest, &mut Vec::new());
            let mut stands = fit.model.effects[index].kind();
            if let Some(best) = self.best(&trials)
                && Self::total(&best.fit) < Self::total(fit) - EQUAL
                && all_may_be(&best.fit)
            {
                *fit = best.fit.clone();
                stands = best.kind;
                others_stay = false;
            }
            tried.push((stands, trials.into()));
        }
        tried
    }

    /// Drops effects that the others have made needless, and that none of the others stands in for against
    /// what its own kind says: winds that blow ahead of every train instead of a tunnel's drag.
    fn prune(&self, fit: &mut Fit, small: &[EffectKind]) {
        let mut index = 0;
        while index < fit.model.effects.len() && fit.model.effects.len() > 1 {
            if small.contains(&fit.model.effects[index].kind()) {
                index += 1;
                continue;
            }
            let rest = self.without(fit, index);
            let evidence = Self::total(&rest) - Self::total(fit);
            let reduction = reduction(self.problem, &rest, fit);
            let is_needless = !is_accepted(fit, index, evidence, reduction) && all_may_be(&rest);
            if is_needless || !may_be(fit, index) {
                *fit = rest;
            } else {
                index += 1;
            }
        }
    }

    /// The model without one effect, refitted.
    pub fn without(&self, fit: &Fit, index: usize) -> Fit {
        let range = fit.model.ranges()[index].clone();
        let mut model = fit.model.clone();
        model.effects.remove(index);
        let kept = fit.theta.iter().enumerate().filter(|(i, _)| !range.contains(i));
        let start = kept.map(|(_, value)| *value).collect();
        self.problem.fit_with_noise(&model, start, fit.noise)
    }
}

/// Whether every effect of a fitted model may be what its kind says.
fn all_may_be(fit: &Fit) -> bool {
    (0..fit.model.effects.len()).all(|index| may_be(fit, index))
}
