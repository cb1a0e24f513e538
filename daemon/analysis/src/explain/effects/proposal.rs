//! A kind of effect: how the search treats it (when it is certain, where it is sought, which usual errors it replaces),
//! and its proposals for the data at hand. The policy of a kind stands in its own file and in its row of the library.

use std::sync::Arc;

use dynocar_shared::vocabulary::EffectKind;

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

/// Where strong evidence alone accepts a kind, however little of the error the kind removes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Certainty {
    /// With the usual errors in the model, and without them.
    Anywhere,
    /// Only with the usual errors in the model, which otherwise look like the kind.
    WithNuisance,
    /// Nowhere: only the acceptance score accepts it.
    Never,
}

/// A declared figure that is usually a little wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeclaredFigure {
    /// A share of the traction force.
    Traction,
    /// A share of the brake force.
    Brake,
    /// The time in s between a report and its force.
    Lateness,
    /// A share of the curve resistance.
    Curves,
    /// A share of a when bearings are cold.
    Warming,
    /// A part of the rotating-mass factor. It is seldom weighed and the same in every run, and it scales the
    /// acceleration by all forces and gradients, as a wrong wheel does.
    RotatingMass,
    /// By a share of the gradient that an accelerometer feels.
    FeltGradient,
}

/// An error of declared figures that every railway has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Everyday {
    /// Place among such errors: the most usual has 1, and of one place the stronger comes first.
    pub rank: u8,
    /// Greatest root mean square of its parameters on ordinary days.
    pub most: f64,
}

/// Policy of a kind of effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// Where it may be certain.
    pub certainty: Certainty,
    /// Kinds that take its place where they explain more than it jointly with the usual errors.
    pub gives_way_to: &'static [EffectKind],
    /// Kinds that keep it from being certain while the model has one of them.
    pub uncertain_with: &'static [EffectKind],
    /// Whether its form or place is one of many, even if no end of it was estimated: it must also take from the error.
    pub is_one_of_many: bool,
    /// Whether a wrong gradient or wheel leaves such a force where pieces of the line end, so that a place that was
    /// chosen is not certain jointly with these.
    pub is_left_by_moved_places: bool,
    /// Whether it is sought with the usual errors in the model: it acts on the train by one law at every place.
    pub is_sought_with_nuisance: bool,
    /// The kind as a small error that every railway has; `None` if it is no such error.
    pub everyday: Option<Everyday>,
    /// Whether it makes something late; two such kinds look alike.
    pub is_late: bool,
    /// Whether it acts in the runs in which it is found and in no others.
    pub is_passing: bool,
    /// Declared figures that it estimates: a joint fit gives them no usual error.
    pub frees: &'static [DeclaredFigure],
}

impl Policy {
    /// The policy of a kind about which nothing is unusual.
    pub const USUAL: Policy = Policy {
        certainty: Certainty::Anywhere,
        gives_way_to: &[],
        uncertain_with: &[],
        is_one_of_many: false,
        is_left_by_moved_places: false,
        is_sought_with_nuisance: true,
        everyday: None,
        is_late: false,
        is_passing: false,
        frees: &[],
    };
}
