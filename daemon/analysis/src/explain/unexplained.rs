//! Remainder after the search: whether noise explains it, and where it acts.

use super::answer::Location;
use super::selection::{Refusal, Search, SearchOutcome};
use crate::dataset::DatasetDiagnostic;
use crate::dataset::dataset_diagnostic::OTHER_LINE;
use dynocar_model::words::kind_name;
use dynocar_shared::vocabulary::EffectKind;

/// Time in s over which the remaining force is averaged, long enough that gusts and rail joints average out.
const OVER_S: f64 = 60.0;
/// Greatest share of the basic resistance that noise leaves on average: gusts, the map's error and the force sensors
/// leave up to 0.11 of it in simulated datasets and 0.18 in recorded ones (`unexplained_n_per_kn` of `dynocar-bench
/// explain --verbose`).
const NOISE_SHARE_MAX: f64 = 0.3;

/// Least share of the basic resistance from which a force without a cause outweighs the causes that are found.
const OUTWEIGHS_SHARE: f64 = 1.0;

/// Residual of the finished model.
pub struct Unexplained {
    /// Standard deviation in N/kN of the remaining force, averaged over a minute.
    pub n_per_kn: f64,
    /// The same as a share of the declared basic resistance.
    pub share: f64,
    /// Explanations refused only because a parameter lies at a bound or contradicts the kind, with the refusal: trials
    /// of the last round, strongest first, and where nothing is found, those dropped when the usual errors were
    /// included.
    pub refused: Vec<(EffectKind, Refusal)>,
    /// Where a force outside the library explains most.
    pub place: Option<Location>,
}

impl Unexplained {
    /// Returns the residual of a finished search; `None` without motion.
    pub fn new(search: &Search, outcome: &SearchOutcome) -> Option<Self> {
        let (n_per_kn, share) = search.problem.noise_n_per_kn(outcome.fit.noise, OVER_S)?;
        let last = outcome.rounds.last().into_iter().flat_map(|round| round.iter());
        let tried = last.clone().filter_map(|trial| Some((trial.kind, Search::refusal(trial)?)));
        let is_nothing_found = outcome.fit.model.effects.is_empty();
        let fallen = outcome.fallen.iter().filter(|_| is_nothing_found).copied();
        let leaves = |(_, refusal): &(EffectKind, Refusal)| refusal.leaves_a_residual();
        let mut refused: Vec<_> = tried.filter(leaves).collect();
        for fallen in fallen.filter(leaves) {
            if refused.iter().all(|(kind, _)| *kind != fallen.0) {
                refused.push(fallen);
            }
        }
        let outside = last.clone().find(|trial| trial.kind == EffectKind::Unknown);
        let place = outside.map(|trial| trial.fit.model.effects[trial.last()].place());
        Some(Unexplained { n_per_kn, share, refused, place })
    }

    /// Returns whether noise explains it.
    pub fn is_noise(&self) -> bool {
        self.share < NOISE_SHARE_MAX
    }

    /// Returns its contradiction to the effects found where it is as large as the basic resistance itself, or the line is
    /// in doubt: on another line than that of the runs they take up some of it.
    pub fn contradiction(&self, diagnostics: &[DatasetDiagnostic]) -> Option<&'static str> {
        let is_line_doubted = diagnostics.iter().any(|it| it.code == OTHER_LINE);
        let is_contradicted = self.share >= OUTWEIGHS_SHARE || is_line_doubted && !self.is_noise();
        is_contradicted.then_some(
            "The effects found leave too large a force without a cause: check first that the line, the train and the \
             runs belong together, and change no part before that cause is known.",
        )
    }

    /// It in words.
    pub fn describe(&self) -> String {
        let Unexplained { n_per_kn, share, .. } = self;
        format!(
            " A force of {n_per_kn:.2} N/kN on average over a minute stays unexplained, {:.0} % of \
             the basic resistance.",
            100.0 * share
        )
    }

    /// Describes the explanations of the residual that are not determined; empty if there are none.
    pub fn undetermined(&self) -> String {
        let one = |(kind, refusal): &(EffectKind, Refusal)| {
            format!(" Not determined is {}: {refusal}.", kind_name(kind.name()))
        };
        self.refused.iter().map(one).collect()
    }
}
