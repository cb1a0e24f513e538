//! Another mass than declared, between certain stops or for some time: every force in proportion to the weight grows
//! alike, traction and brake do not.

use dynocar_shared::vocabulary::EffectKind;

use super::{Least, Parameter, Suspect};

/// The list of `[track]` that holds [from in m, to in m, direction, factor].
pub const LIST: &str = "masses";
/// True over declared mass.
pub const PARAMETER: Parameter = Parameter::new("mass_factor", (0.4, 2.5), 0.005);
/// A smaller share of the mass is not worth reporting.
pub const LEAST_SHARE: f64 = 0.012;
/// Standard deviation of a mass that was weighed, or declared for a run, as a share of it.
pub const WEIGHED_STD: f64 = 0.03;
/// The same from run to run on one line, where each run declares its load.
pub const USUAL_STD: f64 = 0.02;

/// Unit: the share of the mass that is added.
pub const SUSPECT: Suspect = Suspect {
    least: Least::Size(0.025),
    changes_at_stops: true,
    ..Suspect::new(EffectKind::MassChange, 0.1, |seen| seen.traction - seen.brake)
};
