//! Effects that are certain jointly with the usual errors of all declared figures, and the scale of the speeds by each
//! source of evidence alone.
//!
//! In every dataset the map's gradients, the scales and lateness of forces, and the loads and winds of single runs have
//! errors. These errors are part of the model here, with their usual spread, and integrated out. An effect that is
//! still evident is certain, however little of the open-loop error it removes.

use std::sync::Arc;

use dynocar_shared::HALF_95;
use dynocar_shared::vocabulary::EffectKind;
use nalgebra::Cholesky;

use super::acceptance::{
    CERTAIN_RUNS_MIN, is_certain, is_left_by_moved_places, is_material, is_possible, moves_places,
};
use super::deviations::{Deviations, deviations, deviations_with_nuisance};
use super::outcome::{
    EffectTrial, NuisanceFit, Refusal, SearchOutcome, at_bound, penalty, round_of,
};
use super::search::Search;
use super::trying::{Asked, PROMISE_TIMES};
use crate::explain::answer::WithStd;
use crate::explain::effects::{
    Candidate, DeclaredFigure, VerticalCurves, map_error, map_error_as_fitted, mass_centre,
    policy_of, rounded_steps, usual_errors,
};
use crate::explain::evidence::{EQUAL, Fit, FitProblem};
use crate::explain::places::{SURVEYED, span_m};

/// Returns whether some evidence makes the last effect of a trial certain jointly with the usual errors.
pub fn is_certain_with_nuisance(trial: &EffectTrial, evidence: f64) -> bool {
    is_material(trial)
        && is_possible(trial)
        && is_certain(&trial.fit, trial.last(), evidence, trial.reduction, true)
}

/// Returns the declared figures that the effects of a model estimate: their own, and those of kinds that the runs
/// cannot distinguish from them.
fn freed_figures(fit: &Fit) -> impl Iterator<Item = &'static DeclaredFigure> {
    let effects = fit.model.effects.iter().enumerate();
    let kinds = effects.flat_map(|(index, effect)| {
        let twins = effect.twins(fit.effect_parameters(index));
        twins.iter().copied().chain([effect.kind()])
    });
    kinds.flat_map(|kind| policy_of(kind).frees)
}

/// Greatest number of searches for the length over which gradient steps are rounded, and the share of the step
/// correction that may remain wrong.
const ROUNDING_TURNS: usize = 3;
const ROUNDING_SHARE: f64 = 0.1;

impl Search<'_> {
    /// Fits the model of the search jointly with the usual errors; a finished fit of the same model is returned again.
    pub fn refit_with_nuisance(&self, outcome: &mut SearchOutcome) -> Arc<NuisanceFit> {
        let fit = &outcome.fit;
        if let Some((from, joint)) = &outcome.nuisance_fit
            && joint.is_of(fit, from)
        {
            return joint.clone();
        }
        let freed: Vec<_> = freed_figures(fit).collect();
        let is_felt = self.problem.runs.iter().any(|run| run.is_gradient_felt);
        let is_usual = |figure: DeclaredFigure| match figure {
            DeclaredFigure::FeltGradient => is_felt,
            _ => !freed.contains(&&figure),
        };
        let usual = usual_errors(fit.theta[0], is_usual);
        let shared = usual.start.len();
        let map_errors = self.map_errors(fit);
        let rounded = map_errors.len().checked_sub(1).map(|last| fit.model.effects.len() + last);
        let errors = map_errors.into_iter().chain([usual]).map(Candidate::parts);
        let mut fit = self.problem.with_runs_apart(self.problem.grown(fit, errors));
        if let Some(rounded) = rounded {
            self.round_as_found(&mut fit, rounded);
        }
        let joint = Arc::new(NuisanceFit { fit, shared });
        outcome.nuisance_fit = Some((outcome.fit.theta.clone(), joint.clone()));
        joint
    }

    /// Returns the errors of the map, the place of the train's mass and the rounding of steps, also for a model with a
    /// greater error of the map that the runs show; empty where there is no map or no measured position.
    fn map_errors(&self, fit: &Fit) -> Vec<Candidate> {
        let track = self.track.filter(|_| self.problem.positions.distance_ratio.is_some());
        let span_m = self.scan(fit).and_then(|scan| span_m(&scan));
        let (Some(track), Some(span_m)) = (track, span_m.filter(|[low, high]| high > low)) else {
            return Vec::new();
        };
        let length_m = self.train.length_m;
        let rounded = rounded_steps(track.clone(), length_m, (VerticalCurves::USUAL, 1.0), 0.0);
        vec![map_error(span_m, SURVEYED), mass_centre(track.clone(), length_m), rounded]
    }

    /// Fits again with steps rounded over the length that a fit shows, where it shows another than the usual one: a
    /// share of another length has another shape, and a rotating mass takes up the difference. Where curves of one
    /// radius fit better, it is these.
    fn round_as_found(&self, fit: &mut Fit, number: usize) {
        let Some(track) = self.track else { return };
        let shows_rounding = self.round_until_whole(fit, (number, VerticalCurves::USUAL));
        let Some(of_radius) = VerticalCurves::of_usual_radius(track).filter(|_| shows_rounding)
        else {
            return;
        };
        let mut other = self.rounded(fit, (number, of_radius), 1.0);
        self.round_until_whole(&mut other, (number, of_radius));
        if other.cost < fit.cost - EQUAL {
            *fit = other;
        }
    }

    /// Fits again with curves of other lengths until these are whole; returns whether any are shown.
    fn round_until_whole(&self, fit: &mut Fit, (number, usual): (usize, VerticalCurves)) -> bool {
        let mut factor = 1.0;
        for turn in 0..ROUNDING_TURNS {
            let at = fit.model.ranges()[number].start;
            let share = fit.theta[at];
            let std = deviations_with_nuisance(fit, fit.theta.len(), 0).std[at];
            let is_shown = std.is_finite() && share > HALF_95 * std;
            if !is_shown || (share - 1.0).abs() < ROUNDING_SHARE {
                return is_shown || turn > 0;
            }
            factor *= share.sqrt();
            *fit = self.rounded(fit, (number, usual), factor);
        }
        true
    }

    /// Fits again with vertical curves that are a factor longer than some usual ones.
    fn rounded(&self, fit: &Fit, (number, usual): (usize, VerticalCurves), factor: f64) -> Fit {
        let Some(track) = self.track else { return fit.clone() };
        let rounded = rounded_steps(track.clone(), self.train.length_m, (usual, factor), 1.0);
        let (mut model, mut theta) = (fit.model.clone(), fit.theta.clone());
        theta[model.ranges()[number].start] = 1.0;
        model.effects[number] = rounded.hypothesis;
        self.problem.fit(&model, theta, fit.noise)
    }

    /// Accepts an effect that is certain jointly with the usual errors; returns false without one.
    ///
    /// The search keeps the map's error in the shape fitted without the effect. A candidate that may be certain is
    /// judged with every number of the map's error free: then the map explains less of the effect.
    pub(super) fn add_certain_effects(&self, outcome: &mut SearchOutcome) -> bool {
        let joint = &self.refit_with_nuisance(outcome).fit;
        if outcome.is_full() || self.problem.runs.len() < CERTAIN_RUNS_MIN {
            return false;
        }
        let looked = self.with_map_as_fitted(&outcome.fit, joint);
        let fallen = outcome.fallen_kinds();
        let is_sought = |kind: EffectKind| {
            let is_sought = policy_of(kind).is_sought_with_nuisance && outcome.may_add(kind);
            is_sought && !fallen.contains(&kind)
        };
        let tried = self.round_of(
            &looked,
            &mut Vec::new(),
            Asked { is_asked: &is_sought, rivals_of: None },
        );
        let may_be =
            |trial: &&EffectTrial| is_certain_with_nuisance(trial, PROMISE_TIMES * trial.bic_gain);
        let are_places_moved = outcome.fit.model.effects.iter().any(moves_places);
        let is_left = |trial: &EffectTrial| {
            are_places_moved && is_left_by_moved_places(&trial.fit.model.effects[trial.last()])
        };
        let may_stand = |trial: &&EffectTrial| may_be(trial) && !is_left(trial);
        let may_be_certain = tried.iter().filter(may_stand);
        let judged = may_be_certain.map(|trial| self.with_map_free(joint, trial));
        let certain: Vec<EffectTrial> =
            judged.filter(|trial| is_certain_with_nuisance(trial, trial.evidence)).collect();
        let best = certain.iter().max_by(|one, other| one.evidence.total_cmp(&other.evidence));
        let Some(found) = best else { return false };
        let kind = found.kind;
        let grown = self.problem.grown(&outcome.fit, [found.last_parts()]);
        outcome.fit = self.problem.with_own_noise(&grown);
        outcome.certain.push((kind, round_of(certain)));
        true
    }

    /// Returns the model jointly with the usual errors, with the map's error in the shape that was fitted.
    fn with_map_as_fitted(&self, fit: &Fit, joint: &Fit) -> Fit {
        let (effects, ranges) = (&joint.model.effects, joint.model.ranges());
        let usual = (fit.model.effects.len()..effects.len()).map(|number| {
            let (own, values) = (effects[number].clone(), &joint.theta[ranges[number].clone()]);
            // A single number keeps its prior: at none it has no shape, and would be determined by nothing.
            if own.is_gradient() && values.len() > 1 {
                map_error_as_fitted(own, values).parts()
            } else {
                (own, values.to_vec())
            }
        });
        self.problem.grown(&self.problem.again(fit, joint.noise), usual)
    }

    /// Returns a trial with every number of the map's error free. Its evidence is the smaller of that under the noise
    /// with the effect and that under the noise without it. The part of the map's error that all runs share is in the
    /// model.
    fn with_map_free(&self, joint: &Fit, trial: &EffectTrial) -> EffectTrial {
        let grown = self.problem.grown(joint, [trial.last_parts()]);
        let free = Self::trial(joint, self.problem.with_own_noise(&grown), trial.kind);
        let (with, last) = (&free.fit, free.last());
        let alike = self.problem.again(joint, with.noise).cost - with.cost - penalty(with, last);
        let has_map_error = with.model.effects.iter().any(|effect| effect.is_gradient());
        let own = if has_map_error { free.bic_gain } else { free.evidence };
        EffectTrial { evidence: own.min(alike), reduction: trial.reduction, ..free }
    }

    /// Drops an effect that does not stand jointly with the usual errors: a force outside the library that explains no
    /// more than chance there, an effect of the library that runs to a bound of its range or may be none there, and a force
    /// or speed no later there than is usual. Returns false without one.
    pub(super) fn drop_fallen(&self, outcome: &mut SearchOutcome) -> bool {
        let joint = self.refit_with_nuisance(outcome);
        let with_usual = &joint.fit;
        let effects = &outcome.fit.model.effects;
        let refusal = |index: usize| {
            let kind = effects[index].kind();
            if !outcome.is_named(kind) {
                return None;
            }
            let is_form = kind == EffectKind::Unknown && !outcome.is_certain(kind);
            let decrease = || self.without(with_usual, index).cost - with_usual.cost;
            if is_form && decrease() <= penalty(with_usual, index) {
                return Some((index, Refusal::Chance));
            }
            if outcome.is_certain(kind) && joint.holds_none(index) {
                return Some((index, Refusal::Chance));
            }
            // The numbers of a profile are no one size.
            let is_sized = effects[index].parameters().len() <= 2 || kind == EffectKind::MassChange;
            let is_none = is_sized && kind != EffectKind::Unknown && joint.holds_none(index);
            if is_none || policy_of(kind).is_late && joint.is_immaterial(index) {
                let is_small = joint.is_immaterial(index);
                return Some((index, if is_small { Refusal::Immaterial } else { Refusal::Chance }));
            }
            if effects[index].place().windows.is_some() && joint.is_as_loads_are(index) {
                return Some((index, Refusal::UsualLoads));
            }
            // A form may be greatest where its covariate's range ends.
            let may_fall = kind != EffectKind::Unknown && at_bound(&outcome.fit, index).is_none();
            let bound = at_bound(with_usual, index).filter(|_| may_fall);
            Some((index, Refusal::AtBound(bound?)))
        };
        let Some((index, refusal)) = (0..effects.len()).find_map(refusal) else { return false };
        outcome.fallen.push((effects[index].kind(), refusal));
        outcome.fit = self.without(&outcome.fit, index);
        true
    }
}

/// Moves the effects that were found to where they fit best with the usual errors in the model, and a, b and c to
/// where they fit best with the effects alone: the prediction of runs knows no usual errors.
pub fn move_to_nuisance_fit(search: &Search, outcome: &mut SearchOutcome) {
    let joint = search.refit_with_nuisance(outcome);
    outcome.likeliest = outcome.fit.clone();
    let fit = &outcome.likeliest;
    let count = fit.theta.len();
    if !fit.model.effects.is_empty() {
        let theta = joint.fit.theta[..count].to_vec();
        outcome.fit = search.problem.with_davis_fitted(&fit.model, theta, fit.noise);
    }
}

/// Standard deviations of the parameters of a model that was moved with the usual errors last, from samples some s
/// apart, with the errors that all runs share.
pub fn deviations_given(problem: &FitProblem, outcome: &SearchOutcome, step_s: f64) -> Deviations {
    let count = outcome.fit.theta.len();
    let Some((_, joint)) = &outcome.nuisance_fit else { return deviations(&outcome.fit) };
    let mut deviations = deviations_with_nuisance(&joint.fit, count, joint.shared);
    deviations.add_shared_errors(problem, &outcome.fit.model, &joint.fit.theta, step_s);
    deviations
}

/// The scale of the speeds by positions alone, and by gradients and forces alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleSources {
    /// By positions.
    pub positions: WithStd,
    /// By gradients and forces, jointly with the usual errors of declared figures.
    pub motion: WithStd,
}

impl ScaleSources {
    /// Returns the scales of a finished model with a wrong wheel; `None` without one, or where one of the two sources
    /// determines nothing.
    pub fn of(problem: &FitProblem, outcome: &SearchOutcome) -> Option<Self> {
        let fit = &outcome.nuisance_fit.as_ref()?.1.fit;
        let scales = |number: &usize| fit.model.effects[*number].nature().changes_speed_scale;
        let wheel = (0..outcome.fit.model.effects.len()).find(scales)?;
        let i = fit.model.ranges()[wheel].start;
        let variance = Cholesky::new(fit.free_information())?.inverse()[(i, i)];
        let (ratio, std) = problem.positions.distance_ratio?;
        let positions = WithStd { value: ratio.recip(), std: std / (ratio * ratio) };
        Some(ScaleSources {
            positions,
            motion: without(WithStd { value: fit.theta[i], std: variance.sqrt() }, positions)?,
        })
    }

    /// Returns whether they are further apart than their 95 % intervals allow.
    pub fn are_apart(&self) -> bool {
        let allowed = HALF_95 * (self.positions.std + self.motion.std);
        (self.positions.value - self.motion.value).abs() > allowed
    }
}

/// Returns an estimate without one of its sources; `None` where nothing is left.
fn without(both: WithStd, source: WithStd) -> Option<WithStd> {
    let [all, own] = [both.std, source.std].map(|std| std.powi(-2));
    let left = all - own;
    (left > 0.0).then(|| WithStd {
        value: (all * both.value - own * source.value) / left,
        std: left.sqrt().recip(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_two_sources_say_together_is_taken_apart_again() {
        let positions = WithStd { value: 1.015, std: 0.001 };
        // Motion at 1.003 ± 0.002: weights of 4 to 1.
        let both = WithStd { value: 1.0126, std: (0.8f64).sqrt() * 1e-3 };
        let motion = without(both, positions).expect("motion says something");
        assert!((motion.value - 1.003).abs() < 1e-9 && (motion.std - 0.002).abs() < 1e-9);
        let apart = ScaleSources { positions, motion };
        assert!(apart.are_apart());
        let near = WithStd { value: 1.012, ..motion };
        assert!(!ScaleSources { positions, motion: near }.are_apart());
        assert_eq!(without(positions, positions), None);
    }
}
