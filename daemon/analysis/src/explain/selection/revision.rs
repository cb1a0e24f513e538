//! Retrial of accepted effects jointly with those found later.

use dynocar_shared::vocabulary::EffectKind;

use super::acceptance::{is_accepted, may_be};
use super::outcome::{Refusal, SearchOutcome, SearchRound, round_of};
use super::search::Search;
use super::trying::Asked;
use crate::explain::effects::{effect_of, policy_of};
use crate::explain::evidence::{EQUAL, Fit};
use crate::explain::score::reduction;

impl Search<'_> {
    /// Removes each effect in turn and tries whether another kind explains more in its place. Records the trials in the
    /// place of each effect; for the last one, while the others stay, they are those of the round that found it.
    pub(super) fn swap(&self, outcome: &mut SearchOutcome, brought_last: SearchRound) {
        let mut tried = Vec::new();
        let kinds = outcome.kinds();
        let mut others_stay = true;
        for (number, kind) in kinds.iter().enumerate() {
            if number == kinds.len() - 1 && others_stay {
                tried.push((*kind, brought_last));
                break;
            }
            let index = outcome.fit.model.position(*kind);
            let Some(index) = index.filter(|_| outcome.is_on_trial(*kind)) else { continue };
            let rest = self.without(&outcome.fit, index);

            let trials = self.rivals(&rest, *kind);
            let mut stands = *kind;
            if let Some(best) = self.best(&trials, &outcome.fallen_kinds())
                && Self::total(&best.fit) < Self::total(&outcome.fit) - EQUAL
                && all_may_be(&best.fit)
            {
                outcome.fit = best.fit.clone();
                stands = best.kind;
                others_stay = false;
            }
            tried.push((stands, round_of(trials)));
        }
        outcome.instead = tried;
    }

    /// Replaces an effect by a kind that explains more than it jointly with the usual errors; returns whether it did.
    /// Without the usual errors an effect that can take their form would win.
    pub(super) fn give_way(&self, outcome: &mut SearchOutcome) -> bool {
        let may_give_way = |kind: &EffectKind| {
            !policy_of(*kind).gives_way_to.is_empty() && outcome.is_on_trial(*kind)
        };
        let Some(kind) = outcome.kinds().into_iter().find(may_give_way) else { return false };
        let Some(index) = outcome.fit.model.position(kind) else { return false };
        let rest = self.without(&outcome.fit, index);
        let is_asked = |other: EffectKind| policy_of(kind).gives_way_to.contains(&other);
        let asked = Asked { is_asked: &is_asked, rivals_of: None };
        let trials = self.round_of(&rest, &mut Vec::new(), asked);
        let Some(best) = self.best(&trials, &outcome.fallen_kinds()) else { return false };
        let own = Self::total(&self.refit_with_nuisance(outcome).fit);
        let mut other = SearchOutcome { fit: best.fit.clone(), ..outcome.clone() };
        if Self::total(&self.refit_with_nuisance(&mut other).fit) > own - EQUAL {
            return false;
        }
        other.fallen.push((kind, Refusal::GivesWay(best.kind)));
        other.instead.push((best.kind, round_of(trials)));
        *outcome = other;
        true
    }

    /// Puts a kind as one number of the whole train or line, such as the drag of all mapped tunnels, in the place of
    /// the same kind at chosen places where that explains more jointly with the usual errors; returns whether it did.
    /// Errors of the map make places of anything, and the more runs pass them, the surer.
    pub(super) fn return_to_whole(&self, outcome: &mut SearchOutcome) -> bool {
        let effects = &outcome.fit.model.effects;
        let whole = effects.iter().enumerate().find_map(|(index, effect)| {
            let kind = effect.kind();
            let is_chosen = effect.site().is_some_and(|site| site.sections.is_some());
            if !is_chosen || !outcome.is_on_trial(kind) || outcome.returned.contains(&kind) {
                return None;
            }
            let rest = self.without(&outcome.fit, index);
            let whole = effect_of(kind)?.whole(&self.scan(&rest)?)?;
            Some((kind, self.problem.with_own_noise(&self.problem.grown(&rest, [whole.parts()]))))
        });
        let Some((kind, fit)) = whole else { return false };
        outcome.returned.push(kind);
        let own = Self::total(&self.refit_with_nuisance(outcome).fit);
        let mut other = SearchOutcome { fit, ..outcome.clone() };
        let is_better = Self::total(&self.refit_with_nuisance(&mut other).fit) < own;
        if is_better {
            *outcome = other;
        }
        is_better
    }

    /// Drops effects that the others, or the noise that remains with them, have made needless, unless one of the others would then have impossible parameters
    /// (winds that blow against every train instead of a tunnel's drag), and effects that have such parameters
    /// themselves.
    pub(super) fn prune(&self, outcome: &mut SearchOutcome) {
        let mut index = 0;
        while index < outcome.fit.model.effects.len() {
            let fit = &outcome.fit;
            if !outcome.is_on_trial(fit.model.effects[index].kind()) {
                index += 1;
                continue;
            }
            let rest = self.without(fit, index);
            let evidence = Self::total(&rest) - Self::total(fit);
            let reduction = reduction(self.problem, &rest, fit);
            let is_needless = !is_accepted(fit, index, evidence, reduction) && all_may_be(&rest);
            if is_needless || !may_be(fit, index) {
                outcome.fit = rest;
            } else {
                index += 1;
            }
        }
    }
}

/// Returns whether the parameters of every effect of a fitted model are possible for its kind.
fn all_may_be(fit: &Fit) -> bool {
    (0..fit.model.effects.len()).all(|index| may_be(fit, index))
}
