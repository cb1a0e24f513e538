//! How the search treats a kind of effect: when the kind is certain, where it is sought, and which usual errors it
//! replaces. The policy of a kind stands in its own file and in its row of the library.

use dynocar_shared::vocabulary::EffectKind;

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
