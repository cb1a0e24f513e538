//! What is a little wrong besides the effect.

use clap::ValueEnum;
use dynocar_shared::vocabulary::EffectKind;
use dynocar_tests::simulator::Deviations;

/// A world that effects happen in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum World {
    /// Everything but the effect is as declared, to a good survey and calibrated sensors.
    Plain,
    /// Trains of cars on couplings, in a wind of each day.
    Coupled,
    /// Weights, map, curve constant, winds, forces and wheels, all a little wrong at once.
    Rough,
}

impl World {
    /// By how much things are wrong in it.
    pub fn deviations(self) -> Deviations {
        match self {
            World::Plain => Deviations::PLAIN,
            World::Coupled => Deviations::COUPLED,
            World::Rough => Deviations::ROUGH,
        }
    }

    /// Kinds that are in this world, small, whatever else acts: to name them is no error.
    pub fn everyday(self) -> &'static [EffectKind] {
        use EffectKind::{
            ActuatorDelay, BearingTemperature, CurveResistance, GradientError, MassChange,
            TractionGain, WheelDiameter, Wind,
        };
        match self {
            World::Plain | World::Coupled => &[],
            World::Rough => &[
                ActuatorDelay,
                BearingTemperature,
                CurveResistance,
                GradientError,
                MassChange,
                TractionGain,
                WheelDiameter,
                Wind,
            ],
        }
    }
}
