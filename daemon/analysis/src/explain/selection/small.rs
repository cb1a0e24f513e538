//! Certain and small effects: errors of declared figures that every railway has. They are part of the model, but the
//! answer does not name them.
//!
//! Forces may act a tenth of a second late, wheels and force sensors may be a few thousandths off: thousands of samples
//! make such errors certain, and they hardly change the open-loop error. A model without them would count them
//! as noise, which hides important effects.

use dynocar_shared::vocabulary::EffectKind;

use super::acceptance::{CERTAIN, is_accepted};
use super::outcome::{EffectTrial, Refusal, SearchOutcome, penalty};
use super::search::Search;
use crate::explain::effects::{SharedHypothesis, policy_of};
use crate::explain::evidence::{EQUAL, Fit};
use crate::explain::score::reduction;
use crate::statistics::rms;

/// Returns whether an everyday kind is certain, and refused only because it is small.
fn is_certain_and_small(trial: &EffectTrial) -> bool {
    let refusal = Search::refusal(trial);
    let late = trial.fit.model.effects.iter().filter(|it| policy_of(it.kind()).is_late).count();
    let everyday = policy_of(trial.kind).everyday;
    trial.evidence > CERTAIN
        && everyday.is_some_and(|it| rms(trial.fit.effect_parameters(trial.last())) <= it.most)
        // The kinds that make something late look alike: one of them is enough.
        && late <= 1
        && matches!(refusal, Some(Refusal::Immaterial | Refusal::Weak(_)))
}

impl Search<'_> {
    /// Returns the model with all everyday kinds among the trials that are certain jointly with each other, and only
    /// for their size no effects, the most usual first; `None` without one. Late forces and a late speed look alike:
    /// one of them is enough.
    pub(super) fn with_certain_and_small(
        &self,
        trials: &[EffectTrial],
    ) -> Option<(Vec<EffectKind>, Fit)> {
        let rank = |trial: &EffectTrial| policy_of(trial.kind).everyday.map(|it| it.rank);
        let mut everyday: Vec<&EffectTrial> =
            trials.iter().filter(|it| rank(it).is_some()).collect();
        everyday.sort_by_key(|trial| rank(trial));
        let mut taken: Option<(Vec<EffectKind>, Fit)> = None;
        for alone in everyday.into_iter().filter(|trial| is_certain_and_small(trial)) {
            let Some((kinds, fit)) = &mut taken else {
                taken = Some((vec![alone.kind], alone.fit.clone()));
                continue;
            };
            let grown = self.problem.grown(fit, [alone.last_parts()]);
            let grown = self.problem.with_own_noise(&grown);
            let joint =
                EffectTrial { reduction: alone.reduction, ..Self::trial(fit, grown, alone.kind) };
            if is_certain_and_small(&joint) {
                kinds.push(joint.kind);
                *fit = joint.fit;
            }
        }
        taken
    }

    /// Returns the model with the strongest trial, where that is an everyday kind, certain and only for its size no
    /// effect: an effect that explains less may be no more than its remainder.
    pub(super) fn stronger_and_small(
        trials: &[EffectTrial],
        best: &EffectTrial,
    ) -> Option<(Vec<EffectKind>, Fit)> {
        let strongest = trials.first()?;
        let is_stronger = strongest.bic_gain > best.bic_gain + EQUAL;
        (is_stronger && is_certain_and_small(strongest))
            .then(|| (vec![strongest.kind], strongest.fit.clone()))
    }

    /// Names effects that have turned out to matter jointly with those found. Removes small effects where nothing was
    /// found, and those that are no longer certain jointly with the effects found.
    pub(super) fn finalise_minor_effects(&self, outcome: &mut SearchOutcome) {
        let kinds = outcome.kinds();
        outcome.small.retain(|small| kinds.contains(small));
        let usual = self.usual_scales(outcome);
        let named = usual.iter().filter(|kind| outcome.is_named(**kind));
        outcome.small.extend(named.copied().collect::<Vec<_>>());
        if kinds.len() == outcome.small.len() {
            self.keep_values_of_small(outcome);
            outcome.fit = outcome.base.clone();
            return;
        }
        for kind in kinds {
            let fit = &outcome.fit;
            let index = fit.model.position(kind);
            let Some(index) = index.filter(|_| !outcome.is_named(kind)) else { continue };
            let rest = self.without(fit, index);
            let evidence = rest.cost - fit.cost - penalty(fit, index);
            let effect = &fit.model.effects[index];
            let is_material = effect.is_material(fit.effect_parameters(index), fit.theta[2]);
            let is_effect = is_material && !usual.contains(&kind) && {
                is_accepted(fit, index, evidence, reduction(self.problem, &rest, fit))
            };
            if is_effect || evidence <= CERTAIN {
                outcome.small.retain(|small| *small != kind);
            }
            if !is_effect && evidence <= CERTAIN {
                outcome.fit = rest;
            }
        }
    }

    /// Keeps the values of small effects jointly with the usual errors, and of these effects those of which something is
    /// left there.
    fn keep_values_of_small(&self, outcome: &mut SearchOutcome) {
        if outcome.small.is_empty() {
            return;
        }
        let joint = self.refit_with_nuisance(outcome);
        let effects = outcome.fit.model.effects.iter().enumerate();
        let (none, left): (Vec<_>, Vec<_>) =
            effects.partition(|(index, _)| joint.holds_none(*index));
        let values = |index: usize| joint.fit.effect_parameters(index).to_vec();
        outcome.small_values = left.iter().map(|(index, it)| (it.kind(), values(*index))).collect();
        outcome.small = left.iter().map(|(_, it)| it.kind()).collect();
        outcome.small_or_none = none.iter().map(|(_, it)| it.kind()).collect();
    }

    /// Returns the everyday scales of which little is left jointly with the usual errors: no more than is usual, or the
    /// 95 % interval of their size holds zero.
    fn usual_scales(&self, outcome: &mut SearchOutcome) -> Vec<EffectKind> {
        let is_scale = |effect: &SharedHypothesis| {
            policy_of(effect.kind()).everyday.is_some() && effect.parameters().len() == 1
        };
        if !outcome.fit.model.effects.iter().any(is_scale) {
            return Vec::new();
        }
        let joint = self.refit_with_nuisance(outcome);
        let scales = outcome.fit.model.effects.iter().enumerate();
        let is_usual = |index| joint.holds_none(index) || joint.is_immaterial(index);
        let usual = scales.filter(|(index, effect)| is_scale(effect) && is_usual(*index));
        usual.map(|(_, effect)| effect.kind()).collect()
    }
}
