//! The effects that the monitor looks for, each with one column of the regression.

use dynocar_shared::vocabulary::EffectKind;

use crate::pipeline::resistance::regression::UNKNOWNS;

/// Columns of the base model: a, b, c, two force scales, the delay.
pub const BASE: usize = UNKNOWNS;
/// Suspects with a column of their own.
pub const SUSPECTS: usize = 10;
/// Onsets of a dragging brake that are kept side by side.
pub const ONSETS: usize = 12;
/// Place of the first onset among the parameters.
pub const FIRST_ONSET: usize = BASE + SUSPECTS;
/// All parameters of the regression.
pub const PARAMETERS: usize = FIRST_ONSET + ONSETS;

/// How large an effect must be to be worth naming.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Least {
    /// Its parameter itself.
    Size(f64),
    /// Its force where it acts, as so many times the monitor's share of the resistance there.
    Share(f64),
}

/// One effect that is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
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
}

/// Places in [`BANK`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Unit: the share of c v² that is added in a tunnel.
    TunnelDrag = 0,
    /// Unit: 1000 N/kN m of k in k/R.
    CurveResistance,
    /// Unit: 1 m/s of wind against direction +1.
    Wind,
    /// Unit: the share of the mass that is added.
    MassChange,
    /// Unit: the share of the traction force that is missing.
    TractionGain,
    /// Unit: what is added to the rotating-mass factor.
    RotatingMass,
    /// Unit: the declared a, added at a cold start.
    BearingTemperature,
    /// Unit: the share of w0 added for 10 K more.
    AmbientTemperature,
    /// Unit: the force that was found at the same place in earlier passes.
    LocalResistance,
    /// Unit: the share of the brake force that is missing.
    LowAdhesion,
}

const fn suspect(effect: EffectKind, prior_std: f64, is_positive: bool, least: Least) -> Suspect {
    Suspect { effect, prior_std, is_positive, least, changes_at_stops: false }
}

/// Every suspect in the order of [`Place`].
pub const BANK: [Suspect; SUSPECTS] = [
    suspect(EffectKind::TunnelDrag, 1.0, true, Least::Share(1.0)),
    suspect(EffectKind::CurveResistance, 0.7, false, Least::Share(1.0)),
    suspect(EffectKind::Wind, 5.0, false, Least::Share(1.0)),
    Suspect {
        changes_at_stops: true,
        ..suspect(EffectKind::MassChange, 0.1, false, Least::Size(0.025))
    },
    suspect(EffectKind::TractionGain, 0.06, false, Least::Size(0.02)),
    suspect(EffectKind::RotatingMass, 0.05, false, Least::Size(0.02)),
    suspect(EffectKind::BearingTemperature, 1.0, true, Least::Share(1.0)),
    suspect(EffectKind::AmbientTemperature, 0.1, false, Least::Share(0.7)),
    suspect(EffectKind::LocalResistance, 1.0, true, Least::Share(1.0)),
    Suspect {
        changes_at_stops: true,
        ..suspect(EffectKind::LowAdhesion, 0.2, true, Least::Size(0.04))
    },
];

/// A dragging brake; its unit is 1 N/kN.
pub const DRAGGING_BRAKE: Suspect =
    suspect(EffectKind::DraggingBrake, 1.5, true, Least::Share(1.0));

/// The suspect behind a parameter beyond the base model.
pub fn suspect_of(parameter: usize) -> &'static Suspect {
    if parameter >= FIRST_ONSET { &DRAGGING_BRAKE } else { &BANK[parameter - BASE] }
}

/// The parameter of a suspect with a column of its own.
pub const fn parameter_of(place: Place) -> usize {
    BASE + place as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bank_is_in_the_order_of_its_places() {
        assert_eq!(suspect_of(parameter_of(Place::TunnelDrag)).effect, EffectKind::TunnelDrag);
        assert_eq!(suspect_of(parameter_of(Place::Wind)).effect, EffectKind::Wind);
        assert_eq!(suspect_of(parameter_of(Place::RotatingMass)).effect, EffectKind::RotatingMass);
        assert_eq!(suspect_of(parameter_of(Place::LowAdhesion)).effect, EffectKind::LowAdhesion);
        assert_eq!(suspect_of(FIRST_ONSET).effect, EffectKind::DraggingBrake);
    }
}
