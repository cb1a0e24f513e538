//! Descriptions of every term: the keys of its numbers in the files and their ranges, its estimated parameters, and the
//! way in which the monitor looks for it while the train runs.

use dynocar_shared::vocabulary::EffectKind;

use super::extra::ExtraResistance;
use crate::train::numbers::{Davis, Key};

/// One entry that a finding makes in the files.
#[derive(Clone, Debug, PartialEq)]
pub enum ModelEntry {
    /// A number of `train.toml`.
    Number(&'static Key, f64),
    /// A number of `[track]` that adds to a declared one.
    TrackNumber(&'static str, f64),
    /// A list of `[track]` that no other list may join: it is held only where the line declares none of that name.
    List(&'static str, Vec<Vec<f64>>),
    /// Further rows of a list of `[track]`.
    Rows(&'static str, Vec<Vec<f64>>),
    /// A further table of `[[extra]]` of `train.toml`.
    Extra(ExtraResistance),
}

/// A parameter of a term, as a fit uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in the answer.
    pub name: &'static str,
    /// Least value.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
    /// Step for finite differences.
    pub step: f64,
}

impl Parameter {
    /// Returns a parameter with its bounds.
    pub const fn new(name: &'static str, (lower, upper): (f64, f64), step: f64) -> Self {
        Parameter { name, lower, upper, step }
    }
}

/// How large an effect must be to be worth naming.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Least {
    /// Its parameter itself.
    Size(f64),
    /// Its force where it acts, as a multiple of the monitor's share of the resistance there.
    Share(f64),
}

/// Inputs at a sample, forces in N/kN.
#[derive(Clone, Copy, Debug)]
pub struct SuspectInput {
    /// Speed in m/s.
    pub speed_mps: f64,
    /// +1 while the chainage grows, -1 while it falls.
    pub direction: f64,
    /// Mean of 1/R along the train in 1/m, where curves are known.
    pub curvature_per_m: Option<f64>,
    /// Share of the train inside tunnels, where these are known.
    pub tunnel_share: Option<f64>,
    /// Outside temperature in °C.
    pub ambient_temperature_degc: Option<f64>,
    /// Time in s since the bearings were cold.
    pub since_cold_s: f64,
    /// The declared Davis coefficients.
    pub davis: Davis,
    /// Traction.
    pub traction: f64,
    /// Brake, retarding.
    pub brake: f64,
    /// Traction minus brake minus all that is known to retard.
    pub driving: f64,
    /// The force found at the same place in earlier passes, as a resistance.
    pub earlier: f64,
    /// The same as an error of the gradient, as it acts in this direction.
    pub earlier_uphill: f64,
}

/// One effect that is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Suspect {
    /// The effect.
    pub effect: EffectKind,
    /// Standard deviation of its parameter before the data.
    pub prior_std: f64,
    /// True when only positive parameters make sense.
    pub is_positive: bool,
    /// The least size worth naming.
    pub least: Least,
    /// True when it may be another after each stop.
    pub changes_at_stops: bool,
    /// The retarding force in N/kN of one unit.
    pub unit: fn(&SuspectInput) -> f64,
}

impl Suspect {
    /// Returns an effect of either sign that stays through stops and is worth naming from the monitor's own share of the
    /// resistance on.
    pub const fn new(effect: EffectKind, prior_std: f64, unit: fn(&SuspectInput) -> f64) -> Self {
        let least = Least::Share(1.0);
        Suspect { effect, prior_std, is_positive: false, least, changes_at_stops: false, unit }
    }
}
