//! When a force outside the library is looked for: where the library leaves a force, or where the noise estimated with
//! an undeclared force in the data may hide one.

use dynocar_shared::vocabulary::EffectKind;

use super::acceptance::is_possible;
use super::outcome::{EffectTrial, SearchOutcome, penalty};
use super::search::Search;
use crate::explain::effects::{Effect, UNKNOWN, a_form_explains_more, leaves_a_force};
use crate::explain::evidence::{EQUAL, Fit, SCORE_MIN};
use crate::explain::scan::Scan;
use crate::explain::score::FitErrors;

/// Noise may hide a force where its average over this many s exceeds this share of the basic resistance: two to three
/// times the usual share where nothing is left.
const NOISE_OVER_S: f64 = 60.0;
const HOLDS_A_FORCE: f64 = 0.05;
/// A form with its initial numbers explains at least this share of its gain with fitted numbers: the edges tried lie a
/// quarter of the range apart.
const COARSE_SHARE: f64 = 0.25;

impl Search<'_> {
    /// Returns whether a form explains more than the best kind of the library, or that kind leaves a force that has
    /// some form.
    pub(super) fn asks_for_a_form(&self, scan: &Scan, trials: &[(EffectTrial, &Effect)]) -> bool {
        let best = best_possible(trials);
        let explained = best.map_or(0.0, |best| best.bic_gain);
        let left = self.scan(best.map_or(scan.fit, |best| &best.fit));
        left.is_some_and(|left| leaves_a_force(&left))
            || a_form_explains_more(scan, explained.max(SCORE_MIN))
    }

    /// Replaces a trial outside the library by a form that the noise hides, where this form explains more.
    pub(super) fn take_form_that_noise_holds(
        &self,
        base: &Fit,
        trials: &mut Vec<(EffectTrial, &'static Effect)>,
    ) {
        if base.model.has(EffectKind::Unknown) {
            return;
        }
        let is_unknown = |kind: EffectKind| kind == EffectKind::Unknown;
        let Some(form) = self.form_that_noise_holds(base, trials) else { return };
        let own = trials.iter().find(|(trial, _)| is_unknown(trial.kind));
        if own.is_none_or(|(own, _)| own.bic_gain < form.bic_gain) {
            trials.retain(|(trial, _)| !is_unknown(trial.kind));
            trials.push((form, UNKNOWN));
        }
    }

    /// The best form under a noise too small to hold a force, where the noise of a fit may hold one
    /// and some form explains more under the small one than the kind of the library that explains
    /// most.
    fn form_that_noise_holds(
        &self,
        base: &Fit,
        trials: &[(EffectTrial, &Effect)],
    ) -> Option<EffectTrial> {
        let (_, share) = self.problem.noise_n_per_kn(base.noise, NOISE_OVER_S)?;
        if share < HOLDS_A_FORCE {
            return None;
        }
        let noise = *base.noise.stiffer().first()?;
        let onto = self.problem.again(base, noise);
        let explained = best_possible(trials).map_or(0.0, |best| {
            let with = self.problem.again(&best.fit, noise);
            onto.cost - with.cost - penalty(&with, best.last())
        });
        let scan = self.scan(&onto)?;
        a_form_explains_more(&scan, (COARSE_SHARE * explained).max(SCORE_MIN))
            .then(|| self.look_again(base, noise, UNKNOWN).map(|it| it.0))
            .flatten()
    }

    /// Looks for a form of the remaining force under noises too small to hide it: the noise of a model that lacks a
    /// large force contains that force. A form that is found replaces all effects found before, or joins them, by which
    /// explains more.
    pub fn look_under_noise(&self, outcome: &mut SearchOutcome) {
        let models = [outcome.base.clone(), outcome.fit.clone()];
        for base in models.iter().take(1 + usize::from(!outcome.fit.model.effects.is_empty())) {
            if base.model.has(EffectKind::Unknown) {
                continue;
            }
            let before = FitErrors::new(self.problem, base);
            for noise in base.noise.stiffer() {
                let Some((mut trial, _)) = self.look_again(base, noise, UNKNOWN) else { continue };
                trial.reduction = FitErrors::new(self.problem, &trial.fit).reduction_from(&before);
                let is_better = Self::total(&trial.fit) < Self::total(&outcome.fit) - EQUAL;
                if is_better && Self::refusal(&trial).is_none() {
                    outcome.fit = trial.fit;
                }
            }
        }
    }
}

/// Returns the possible trial of the library that explains most.
fn best_possible<'t>(trials: &'t [(EffectTrial, &Effect)]) -> Option<&'t EffectTrial> {
    let trials = trials.iter().map(|(trial, _)| trial);
    let possible =
        trials.filter(|it| it.bic_gain > 0.0 && it.kind != EffectKind::Unknown && is_possible(it));
    possible.max_by(|one, other| one.bic_gain.total_cmp(&other.bic_gain))
}
