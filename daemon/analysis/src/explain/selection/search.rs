//! Forward search for effects, with a swap pass and pruning.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use dynocar_model::track::Track;
use dynocar_model::train::TrainModel;
use dynocar_shared::vocabulary::EffectKind;

use super::outcome::{EffectTrial, SearchOutcome, model_penalty, round_of};
use crate::explain::effects::Effect;
use crate::explain::evidence::{EQUAL, Fit, FitProblem, RunData, UpdatedModel};
use crate::explain::scan::Scan;

/// Receives the progress, from any thread: the share done and the present work. It may unwind to end the work, which
/// leaves nothing to clean up.
pub type Progress<'p> = &'p (dyn Fn(f64, &str) + Sync);

/// Number of finished steps of a round, over all threads.
pub struct RoundSteps<'s> {
    progress: Progress<'s>,
    round: usize,
    count: usize,
    done: AtomicUsize,
}

/// Share of the search done before a round ends: the number of rounds is not known, and most searches have few.
pub fn round_share(round: usize, done: f64) -> f64 {
    let left = 0.5f64.powi(round as i32) * (1.0 - 0.5 * done);
    0.05 + 0.9 * (1.0 - left)
}

impl<'s> RoundSteps<'s> {
    /// Returns the progress of a round after `round` effects, which takes `count` steps at most.
    pub fn of(progress: Progress<'s>, round: usize, count: usize) -> Self {
        RoundSteps { progress, round, count, done: AtomicUsize::new(0) }
    }

    /// Does one step for a kind.
    pub fn done_with<T>(&self, effect: &Effect, step: impl FnOnce() -> T) -> T {
        let share = || self.done.load(Ordering::Relaxed) as f64 / self.count as f64;
        (self.progress)(round_share(self.round, share()), effect.kind.name());
        let result = step();
        self.done.fetch_add(1, Ordering::Relaxed);
        (self.progress)(round_share(self.round, share()), effect.kind.name());
        result
    }
}

/// Greatest number of rounds: an effect that is accepted and dropped by turns must come to an end.
const ROUNDS_MAX: usize = 10;
/// Least number of observations that can show an effect.
pub const OBSERVATIONS_MIN: usize = 80;

/// The search over one dataset.
pub struct Search<'a> {
    /// The fit runs.
    pub problem: &'a FitProblem,
    /// Holdout runs, whose speeds the search does not use.
    pub holdout: &'a [RunData],
    /// The declared train.
    pub train: &'a TrainModel,
    /// The declared line.
    pub track: Option<&'a Arc<Track>>,
    /// Receives the progress of the search.
    pub progress: Progress<'a>,
}

impl Search<'_> {
    /// The declared model with a, b, c refitted, and no search for effects.
    pub fn base(&self) -> SearchOutcome {
        (self.progress)(0.05, "fitting a, b, c");
        let base = self.problem.fit_from_declared(&UpdatedModel::default(), &[]);
        SearchOutcome {
            base: base.clone(),
            likeliest: base.clone(),
            fit: base,
            rounds: Vec::new(),
            instead: Vec::new(),
            not_testable: Vec::new(),
            small: Vec::new(),
            small_or_none: Vec::new(),
            small_values: Vec::new(),
            certain: Vec::new(),
            fallen: Vec::new(),
            returned: Vec::new(),
            nuisance_fit: None,
        }
    }

    /// Searches.
    pub fn run(&self) -> SearchOutcome {
        let mut outcome = self.base();
        if outcome.base.observations() < OBSERVATIONS_MIN {
            return outcome;
        }
        self.add_scored_effects(&mut outcome);
        loop {
            while self.add_certain_effects(&mut outcome)
                || self.drop_fallen(&mut outcome)
                || self.give_way(&mut outcome)
                || self.return_to_whole(&mut outcome)
            {
                self.add_scored_effects(&mut outcome);
            }
            // Certain and small effects have joined since; an effect that they leave too little to take may be
            // certain itself.
            let before = outcome.kinds();
            self.prune(&mut outcome);
            if outcome.kinds() == before || !self.add_certain_effects(&mut outcome) {
                break;
            }
        }
        self.finalise_minor_effects(&mut outcome);
        outcome
    }

    /// Accepts effects that remove much of the error for their evidence, and effects that are certain alone, until none
    /// is left.
    fn add_scored_effects(&self, outcome: &mut SearchOutcome) {
        let most = outcome.rounds.len() + ROUNDS_MAX;
        // Kinds that others replaced at once are not tried again either.
        let mut fruitless = outcome.fallen_kinds();
        while !outcome.is_full() && outcome.rounds.len() < most {
            if !outcome.may_add(EffectKind::Unknown) {
                fruitless.push(EffectKind::Unknown);
            }
            let trials = self.round(&outcome.fit, &mut outcome.not_testable);
            let best = self.best(&trials, &fruitless);
            let small = match best {
                None => self.with_certain_and_small(&trials),
                Some(best) => Self::stronger_and_small(&trials, best),
            };
            let next = best.map(|trial| (trial.kind, trial.fit.clone()));
            let round = round_of(trials);
            outcome.rounds.push(round.clone());
            if let Some((kinds, fit)) = small {
                outcome.small.extend(kinds);
                outcome.fit = fit;
                continue;
            }
            let Some((kind, next)) = next else { break };
            let before = outcome.kinds();
            let tried = outcome.instead.clone();
            outcome.fit = next.clone();
            if next.model.effects.len() > 1 {
                (self.progress)(round_share(outcome.rounds.len(), 0.0), "swapping effects");
                self.swap(outcome, round.clone());
            }
            self.prune(outcome);
            // An effect that others replaced, and which then left themselves, is better than no effect.
            if outcome.kinds() == before && Self::total(&next) < Self::total(&outcome.fit) - EQUAL {
                outcome.fit = next;
                outcome.instead = tried;
                outcome.instead.push((kind, round));
                self.prune(outcome);
            }
            if outcome.kinds() == before {
                fruitless.push(kind);
            }
        }
    }

    /// Returns the trial to accept: the one with the strongest evidence, or one with about the same that removes more
    /// of the open-loop error. A force outside the library must explain more than every kind of the library.
    pub(super) fn best<'t>(
        &self,
        trials: &'t [EffectTrial],
        except: &[EffectKind],
    ) -> Option<&'t EffectTrial> {
        let asked = trials.iter().filter(|trial| !except.contains(&trial.kind));
        let accepted: Vec<&EffectTrial> =
            asked.filter(|trial| Self::refusal(trial).is_none()).collect();
        let strongest = accepted.first()?;
        accepted
            .iter()
            .take_while(|trial| trial.bic_gain > strongest.bic_gain - EQUAL)
            .filter(|trial| trial.kind != EffectKind::Unknown)
            .max_by(|one, other| one.reduction.total_cmp(&other.reduction))
            .or(Some(strongest))
            .copied()
    }

    /// A scan around a fit; `None` when the fit's information is singular.
    pub fn scan<'s>(&'s self, fit: &'s Fit) -> Option<Scan<'s>> {
        Scan::new(self.problem, self.holdout, self.train, self.track, fit)
    }

    /// Total cost of a model: fit and price.
    pub(super) fn total(fit: &Fit) -> f64 {
        fit.cost + model_penalty(fit)
    }

    /// Returns the model without one effect, refitted.
    pub fn without(&self, fit: &Fit, index: usize) -> Fit {
        let (model, start) = fit.model.without(&fit.theta, index);
        self.problem.fit_with_noise(&model, start, fit.noise)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::explain::effects::LIBRARY;

    #[test]
    fn shares_grow_from_step_to_step_and_from_round_to_round() {
        let shares = Mutex::new(Vec::new());
        let progress = |share: f64, _: &str| shares.lock().unwrap().push(share);
        for round in 0..5 {
            let steps = RoundSteps::of(&progress, round, 3);
            (0..3).for_each(|_| steps.done_with(&LIBRARY[0], || ()));
        }
        let shares = shares.into_inner().unwrap();
        assert_eq!(shares.len(), 30);
        assert!(shares.windows(2).all(|pair| pair[0] <= pair[1]), "{shares:?}");
        assert!(shares[0] > 0.0 && shares[29] < 1.0);
    }
}
