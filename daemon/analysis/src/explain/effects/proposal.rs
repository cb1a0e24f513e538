//! Proposals of a kind of effect for the data at hand.

use std::sync::Arc;

use dynocar_shared::vocabulary::EffectKind;

use super::policy::Policy;
use crate::explain::hypothesis::{Handling, Hypothesis, SharedHypothesis};
use crate::explain::scan::Scan;

/// A hypothesis with values to start the fit from.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The structure.
    pub hypothesis: SharedHypothesis,
    /// Values of its parameters.
    pub start: Vec<f64>,
}

impl Candidate {
    /// A candidate from a hypothesis.
    pub fn new(hypothesis: impl Hypothesis + 'static, start: Vec<f64>) -> Self {
        Candidate { hypothesis: Arc::new(hypothesis), start }
    }

    /// Returns whether it has ends, runs or a course along the line, of which there are many.
    pub fn is_chosen_among_many(&self) -> bool {
        let of = &self.hypothesis;
        !of.ends().is_empty() || of.is_event() || of.is_gradient()
    }

    /// Returns whether its structure is the only one, independent of the remaining residual.
    pub fn is_fixed(&self) -> bool {
        !self.is_chosen_among_many() && self.hypothesis.nature().choice_cost == 0.0
    }

    /// Returns the structure and a start for the fit: no effect where the model is linear in the values, which a fit
    /// then finds in one step; otherwise the values.
    pub fn from_none(self) -> (SharedHypothesis, Vec<f64>) {
        let effect = &self.hypothesis;
        let is_linear = match effect.nature().handling {
            Handling::Gradient => true,
            Handling::Added => self.start.len() == 1,
            Handling::Together => false,
        };
        let start = if is_linear { vec![effect.none(); self.start.len()] } else { self.start };
        (self.hypothesis, start)
    }

    /// The structure and the values.
    pub fn parts(self) -> (SharedHypothesis, Vec<f64>) {
        (self.hypothesis, self.start)
    }
}

/// Proposals of a kind: structures worth a fit, or the reason why the data do not allow a test.
pub type Proposal = Result<Vec<Candidate>, String>;

/// The kind as one number of the whole train or line, with no place or run chosen.
pub enum Whole {
    /// The kind has no such form.
    None,
    /// Its first structure is.
    First,
    /// By a search of its own; `None` where the data do not allow to test it.
    Of(fn(&Scan) -> Option<Candidate>),
}

/// A kind of effect.
pub struct Effect {
    /// Its name.
    pub kind: EffectKind,
    /// How the search treats it.
    pub policy: Policy,
    propose: fn(&Scan) -> Proposal,
    whole: Whole,
}

impl Effect {
    /// Returns a kind with its search, which is treated as usual.
    pub const fn new(kind: EffectKind, propose: fn(&Scan) -> Proposal, whole: Whole) -> Self {
        Effect { kind, policy: Policy::USUAL, propose, whole }
    }

    /// Returns the kind with a policy of its own.
    pub const fn with(self, policy: &Policy) -> Self {
        Effect { policy: *policy, ..self }
    }

    /// Proposes structures for the data at hand, given the residual of the current model.
    pub fn propose(&self, scan: &Scan) -> Proposal {
        (self.propose)(scan)
    }

    /// Returns the kind as one number of the whole train or line, with no place or run chosen; `None` if it has no
    /// such number, or where the data do not allow to test it.
    pub fn whole(&self, scan: &Scan) -> Option<Candidate> {
        match self.whole {
            Whole::None => None,
            Whole::First => self.propose(scan).ok()?.into_iter().next(),
            Whole::Of(whole) => whole(scan),
        }
    }
}
