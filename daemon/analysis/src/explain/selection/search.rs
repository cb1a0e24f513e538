//! Forward search with a swap pass and pruning.

use std::sync::Arc;

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::vocabulary::EffectKind;
use rayon::prelude::*;

use super::outcome::{Outcome, Round, Trial};
use super::price::{discounted, model_penalty, penalty};
use super::steps::{Progress, Steps, round_share};
use crate::explain::effects::{Candidate, Effect, LIBRARY, Proposal, UNKNOWN};
use crate::explain::evidence::{EQUAL, Fit, FitProblem, Noise, RunData, UpdatedModel};
use crate::explain::scan::Scan;
use crate::explain::score::FitErrors;

/// Rounds at most: what is taken in and dropped again must come to an end.
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
            certain: Vec::new(),
        }
    }

    /// Searches.
    pub fn run(&self) -> Outcome {
        let mut outcome = self.base();
        if outcome.base.observations() < OBSERVATIONS_MIN {
            return outcome;
        }
        self.take_what_scores(&mut outcome);
        while self.take_certain_beside(&mut outcome) {
            self.take_what_scores(&mut outcome);
        }
        self.name_or_forget_small(&mut outcome);
        outcome
    }

    /// Takes in what takes much from the error for its evidence, and what is certain alone, until nothing is left
    /// that does.
    fn take_what_scores(&self, outcome: &mut Outcome) {
        let most = outcome.rounds.len() + ROUNDS_MAX;
        // Kinds that others took the place of at once.
        let mut fruitless: Vec<EffectKind> = Vec::new();
        while !outcome.is_full() && outcome.rounds.len() < most {
            let trials = self.round(&outcome.fit, &mut outcome.not_testable);
            let next = self.best(&trials, &fruitless).map(|trial| (trial.kind, trial.fit.clone()));
            let small = Self::certain_and_small(&trials).filter(|_| next.is_none());
            let small = small.map(|trial| (trial.kind, trial.fit.clone()));
            let round = Round::from(trials);
            outcome.rounds.push(round.clone());
            if let Some((kind, fit)) = small {
                outcome.small.push(kind);
                outcome.fit = fit;
                continue;
            }
            let Some((kind, next)) = next else { break };
            let before = outcome.kinds();
            outcome.fit = next;
            if outcome.fit.model.effects.len() > 1 {
                (self.progress)(round_share(outcome.rounds.len(), 0.0), "swapping effects");
                self.swap(outcome, round);
                self.prune(outcome);
            }
            if outcome.kinds() == before {
                fruitless.push(kind);
            }
        }
    }

    /// The trial to accept: the one with the strongest evidence, or one with about the same that
    /// takes away more of the open-loop error. What is outside the library must explain more than
    /// anything in it.
    pub(super) fn best<'t>(&self, trials: &'t [Trial], except: &[EffectKind]) -> Option<&'t Trial> {
        let asked = trials.iter().filter(|trial| !except.contains(&trial.kind));
        let accepted: Vec<&Trial> = asked.filter(|trial| Self::refusal(trial).is_none()).collect();
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
    pub(super) fn round(
        &self,
        base: &Fit,
        not_testable: &mut Vec<(EffectKind, String)>,
    ) -> Vec<Trial> {
        self.round_of(base, not_testable, |_| true)
    }

    /// The same of some kinds.
    pub(super) fn round_of(
        &self,
        base: &Fit,
        not_testable: &mut Vec<(EffectKind, String)>,
        is_asked: impl Fn(EffectKind) -> bool,
    ) -> Vec<Trial> {
        let Some(scan) = self.scan(base) else { return Vec::new() };
        let steps = Steps::of(self.progress, base.model.effects.len(), LIBRARY.len() + FINALISTS);
        let mut trials = self.try_all(base, &scan, &steps, not_testable, is_asked);
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
        is_asked: impl Fn(EffectKind) -> bool,
    ) -> Vec<(Trial, &'e dyn Effect)> {
        let is_new = |effect: &&dyn Effect| {
            is_asked(effect.kind())
                && !base.model.effects.iter().any(|own| own.kind() == effect.kind())
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

    pub(super) fn trial(base: &Fit, fit: Fit, kind: EffectKind) -> Trial {
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
