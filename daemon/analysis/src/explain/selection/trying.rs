//! Trials of a round: every kind is fitted jointly with the model, and the best kinds once more under their own noise.

use std::sync::{Mutex, PoisonError};

use dynocar_shared::vocabulary::EffectKind;

use super::acceptance::is_possible;
use super::outcome::{EffectTrial, discounted, penalty};
use super::search::{RoundSteps, Search};
use crate::explain::effects::{Candidate, Effect, LIBRARY, UNKNOWN};
use crate::explain::evidence::{Fit, Noise};
use crate::explain::scan::Scan;
use crate::explain::score::FitErrors;
use crate::parallel;
use crate::statistics::greatest_first;

/// Greatest number of kinds that get a noise of their own and a second localisation in each round.
const FINALISTS: usize = 5;
/// BIC gain of a finalist: not far below zero, and no less than this share of the greatest.
const FINALIST_MIN: f64 = -20.0;
const FINALIST_SHARE: f64 = 0.1;
/// The same where only kinds matter that come near a given kind in its place.
const RIVAL_SHARE: f64 = 0.25;
/// Error reduction above which a kind comes before the others. Above this number of observations, where small effects
/// are significant, only such kinds are looked at again.
const FINALIST_ERROR_REDUCTION: f64 = 0.02;
const MANY_OBSERVATIONS: usize = 5_000;
/// Greatest number of attempts of a finalist.
const ATTEMPTS: usize = 3;
/// Factor on a promised gain: a trial that would not pay its price with this multiple of the decrease that its start
/// promises is not fitted to its end; one that would not be certain with this multiple of its evidence is not judged.
pub(super) const PROMISE_TIMES: f64 = 2.0;

/// Which kinds are tried.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    /// Whether a kind is tried.
    pub is_asked: &'a dyn Fn(EffectKind) -> bool,
    /// Only kinds that come near this one matter.
    pub rivals_of: Option<EffectKind>,
}

/// The best candidate of a kind, if any, by this kind or its forms; or why the data do not allow to test it.
type Tried = (&'static Effect, Result<Option<EffectTrial>, String>);

/// Returns whether a numbered attempt comes before another of the same kind. A form at a bound of its numbers is one of
/// another form, and comes after all others that explain anything.
fn is_better(own: &(usize, EffectTrial), other: &(usize, EffectTrial)) -> bool {
    let rank = |(number, trial): &(usize, EffectTrial)| {
        let is_form = trial.kind == EffectKind::Unknown && trial.bic_gain > 0.0;
        (is_form && is_possible(trial), trial.bic_gain, *number)
    };
    let (own, other) = (rank(own), rank(other));
    own.0.cmp(&other.0).then(own.1.total_cmp(&other.1)).then(own.2.cmp(&other.2)).is_gt()
}

/// Returns whether a trial would be more than chance with this multiple of the evidence: an error that all runs
/// share does not become evident by another place or noise.
fn may_be_evident(trial: &EffectTrial) -> bool {
    let price = penalty(&trial.fit, trial.last());
    trial.evidence > FINALIST_MIN || PROMISE_TIMES * (trial.evidence + price) > price
}

impl Search<'_> {
    /// Tries every kind that the model does not have yet; the strongest first.
    pub(super) fn round(
        &self,
        base: &Fit,
        not_testable: &mut Vec<(EffectKind, String)>,
    ) -> Vec<EffectTrial> {
        self.round_of(base, not_testable, Asked { is_asked: &|_| true, rivals_of: None })
    }

    /// Tries a kind and the kinds that could stand in its place.
    pub(super) fn rivals(&self, base: &Fit, kind: EffectKind) -> Vec<EffectTrial> {
        let asked = Asked { is_asked: &|_| true, rivals_of: Some(kind) };
        self.round_of(base, &mut Vec::new(), asked)
    }

    /// Tries those of some kinds that the model does not have yet; the strongest first.
    pub(super) fn round_of(
        &self,
        base: &Fit,
        not_testable: &mut Vec<(EffectKind, String)>,
        asked: Asked,
    ) -> Vec<EffectTrial> {
        let Some(scan) = self.scan(base) else { return Vec::new() };
        let steps =
            RoundSteps::of(self.progress, base.model.effects.len(), LIBRARY.len() + FINALISTS);
        let share = if asked.rivals_of.is_some() { RIVAL_SHARE } else { FINALIST_SHARE };
        let mut trials = self.try_all(base, &scan, &steps, not_testable, asked);
        let before = FitErrors::new(self.problem, base);
        let reduction = |fit: &Fit| FitErrors::new(self.problem, fit).reduction_from(&before);
        let measure = |trials: &mut [(EffectTrial, &Effect)], is_asked: fn(f64) -> bool| {
            let asked = trials.iter_mut().filter(|(trial, _)| is_asked(trial.bic_gain));
            parallel::of_each_owned(asked, |_, (trial, _)| trial.reduction = reduction(&trial.fit));
        };
        measure(&mut trials, |gain| gain > 0.0);
        if !trials.iter().any(|(trial, _)| trial.reduction > FINALIST_ERROR_REDUCTION) {
            measure(&mut trials, |gain| gain > FINALIST_MIN && gain <= 0.0);
        }
        // A trial that takes nothing from the error comes last, and is no measure for the others.
        let helps = |trial: &EffectTrial| trial.reduction > FINALIST_ERROR_REDUCTION;
        greatest_first(&mut trials, |(trial, _)| trial.bic_gain);
        greatest_first(&mut trials, |(trial, _)| f64::from(helps(trial)));
        let greatest = trials.first().map_or(0.0, |(trial, _)| trial.bic_gain);
        let least = FINALIST_MIN.max(share * greatest);
        let is_long = base.observations() > MANY_OBSERVATIONS;
        let mut finished = parallel::of_each_owned(trials, |rank, (trial, effect)| {
            let is_finalist = rank < FINALISTS
                && trial.bic_gain > least
                && (helps(&trial) || !is_long)
                && may_be_evident(&trial);
            if !is_finalist {
                return trial;
            }
            let trial = steps.done_with(effect, || self.finalist(base, trial, effect));
            EffectTrial { reduction: reduction(&trial.fit), ..trial }
        });
        greatest_first(&mut finished, |it| it.bic_gain);
        finished
    }

    /// Tries every kind that the model does not have yet, forces outside the library last.
    fn try_all(
        &self,
        base: &Fit,
        scan: &Scan,
        steps: &RoundSteps,
        not_testable: &mut Vec<(EffectKind, String)>,
        Asked { is_asked, rivals_of }: Asked,
    ) -> Vec<(EffectTrial, &'static Effect)> {
        let is_new = |effect: &&Effect| is_asked(effect.kind) && !base.model.has(effect.kind);
        let (outside, library): (Vec<&Effect>, Vec<&Effect>) =
            LIBRARY.iter().filter(is_new).partition(|it| it.kind == EffectKind::Unknown);
        let (own, library): (Vec<&Effect>, Vec<&Effect>) =
            library.into_iter().partition(|it| rivals_of == Some(it.kind));
        let try_kind = |effect: &'static Effect, least| -> Tried {
            (effect, steps.done_with(effect, || self.try_kind((base, least), scan, effect)))
        };
        let mut trials: Vec<(EffectTrial, &Effect)> = Vec::new();
        let mut take = |trials: &mut Vec<(EffectTrial, &'static Effect)>,
                        (effect, tried): Tried| match tried {
            Ok(best) => trials.extend(best.map(|trial| (trial, effect))),
            Err(_) if not_testable.iter().any(|(kind, _)| *kind == effect.kind) => {}
            Err(reason) => not_testable.push((effect.kind, reason)),
        };
        own.into_iter().for_each(|own| take(&mut trials, try_kind(own, 0.0)));
        let gains = trials.iter().map(|(own, _)| RIVAL_SHARE * own.bic_gain);
        let least = gains.fold(0.0, f64::max);
        let tried = parallel::of_each(&library, |effect| try_kind(effect, least));
        tried.into_iter().for_each(|tried| take(&mut trials, tried));
        let mut has_forms = false;
        for effect in outside {
            has_forms = self.asks_for_a_form(scan, &trials);
            take(&mut trials, try_kind(if has_forms { UNKNOWN } else { effect }, least));
        }
        if !has_forms {
            self.take_form_that_noise_holds(base, &mut trials);
        }
        trials
    }

    /// Returns the best candidate of a kind, jointly with everything accepted so far. A candidate that promises less
    /// than a gain is not fitted to its end.
    fn try_kind(
        &self,
        base: (&Fit, f64),
        scan: &Scan,
        effect: &Effect,
    ) -> Result<Option<EffectTrial>, String> {
        let candidates = effect.propose(scan)?;
        let is_only = candidates.len() == 1 && candidates.iter().all(Candidate::is_fixed);
        let best = self.best_attempt(base, base.0, candidates);
        Ok(best.map(|mut trial| {
            if trial.bic_gain <= FINALIST_MIN {
                // It goes no further.
                trial.fit.forget_series();
            }
            EffectTrial { is_only, ..trial }
        }))
    }

    /// The candidate that explains most for its price, fitted on top of a fit.
    fn best_attempt(
        &self,
        base: (&Fit, f64),
        onto: &Fit,
        candidates: Vec<Candidate>,
    ) -> Option<EffectTrial> {
        // The best so far alone keeps its series.
        let best: Mutex<Option<(usize, EffectTrial)>> = Mutex::new(None);
        parallel::of_each_owned(candidates, |number, candidate| {
            let tried = (number, self.attempt(base, onto, candidate));
            let mut best = best.lock().unwrap_or_else(PoisonError::into_inner);
            let is_better = best.as_ref().is_none_or(|best| is_better(&tried, best));
            if is_better {
                *best = Some(tried);
            }
        });
        best.into_inner().unwrap_or_else(PoisonError::into_inner).map(|it| it.1)
    }

    /// Fits a candidate on top of a fit; its evidence counts against `base`. A candidate that promises less than a gain
    /// is not fitted to its end.
    fn attempt(&self, (base, least): (&Fit, f64), onto: &Fit, candidate: Candidate) -> EffectTrial {
        let kind = candidate.hypothesis.kind();
        let may_pay = |fit: &Fit, promised: f64| {
            let last = fit.model.effects.len() - 1;
            base.cost - fit.cost + PROMISE_TIMES * promised > penalty(fit, last) + least
        };
        let fit = self.problem.grown_if(onto, [candidate.from_none()], may_pay);
        Self::trial(base, fit, kind)
    }

    pub(super) fn trial(base: &Fit, fit: Fit, kind: EffectKind) -> EffectTrial {
        let decrease = base.cost - fit.cost;
        let last = fit.model.effects.len() - 1;
        let price = penalty(&fit, last);
        let evidence = discounted(&fit, last, decrease) - price;
        EffectTrial {
            kind,
            fit,
            bic_gain: decrease - price,
            evidence,
            reduction: 0.0,
            is_only: false,
        }
    }

    /// Gives a trial the noise that remains under it and lets its kind look again for places and windows
    /// under that noise: the noise of the smaller model holds the effect itself. Where there are many to
    /// choose from, it looks under stiff noises too; where there is one, its fit goes on.
    fn finalist(&self, base: &Fit, trial: EffectTrial, effect: &Effect) -> EffectTrial {
        let with_own_noise =
            |fit: &Fit| Self::trial(base, self.problem.with_own_noise(fit), trial.kind);
        let mut best = with_own_noise(&trial.fit);
        for attempt in 0..ATTEMPTS {
            let own = best.fit.noise;
            let look = |noise: Noise| self.look_again(base, noise, effect);
            let (again, many) = if trial.is_only {
                (Some(with_own_noise(&best.fit)), false)
            } else {
                look(own).map_or((None, false), |(trial, many)| (Some(trial), many))
            };
            let noises = if attempt == 0 && many { own.stiffer() } else { Vec::new() };
            let least = best.bic_gain + 1.0;
            let may_win = |(trial, _): &(EffectTrial, bool)| trial.bic_gain > least;
            let stiff = parallel::of_each(&noises, |noise| look(*noise).filter(may_win));
            let mut is_better = false;
            for again in again.into_iter().chain(stiff.into_iter().flatten().map(|it| it.0)) {
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
        effect: &Effect,
    ) -> Option<(EffectTrial, bool)> {
        let onto = self.problem.again(base, noise);
        let scan = self.scan(&onto)?;
        let candidates = effect.propose(&scan).ok()?;
        let many = candidates.len() > 1 || candidates.iter().any(Candidate::is_chosen_among_many);
        let best = self.best_attempt((base, 0.0), &onto, candidates)?;
        Some((Self::trial(base, self.problem.with_own_noise(&best.fit), best.kind), many))
    }
}
