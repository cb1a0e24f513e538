//! A possible input fault, its factor, and the unit that would explain it, in a sentence.

use std::fmt;

use dynocar_model::named;
use dynocar_model::units::{Dimension, Unit};
use dynocar_shared::{PipelineKind, Reason};
use serde::Serialize;

/// A unit is named when its factor differs from the factor found by no more than this share.
const UNIT_TOLERANCE: f64 = 0.2;
/// Forces that are wrong by no more than this factor may as well be right and the mass wrong, as that of one car is.
const MASS_FACTOR_MAX: f64 = 8.0;

/// Recorded over true speed below which the speed stands at 0, or distance by position over that by speed below which
/// the position stands still: of two units of time one is 1e-9 of the other at most.
pub(super) const STUCK_FACTOR: f64 = 1e-10;

/// How much a note matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know.
    Info,
    /// May spoil results.
    Warning,
    /// The data cannot be true, so neither can any result from them.
    Fundamental,
}

named! {
    /// A mistake in a file or in the wiring; in the order in which they are reported.
    #[derive(PartialOrd, Ord, Serialize)]
    #[serde(rename_all = "snake_case")]
    #[repr(u8)]
    InputFault ("for machines") {
        /// Time in another unit.
        TimeScale = 1 "time_scale";
        /// Speed in another unit.
        SpeedScale = 2 "speed_scale";
        /// Position in another unit.
        PositionScale = 3 "position_scale";
        /// The chainage runs against the stated direction.
        DirectionReversed = 4 "direction_reversed";
        /// Mass in another unit.
        MassScale = 5 "mass_scale";
        /// Traction and brake exchanged, or the sign of their difference reversed.
        ForcesSwapped = 6 "forces_swapped";
        /// Both forces in another unit.
        ForcesScale = 7 "forces_scale";
        /// The traction force alone in another unit, or against the motion (factor below zero).
        TractionScale = 8 "traction_scale";
        /// The brake force alone, likewise.
        BrakeScale = 9 "brake_scale";
        /// The gradient falls where it should climb.
        GradientSign = 10 "gradient_sign";
        /// Gradient in another unit.
        GradientScale = 11 "gradient_scale";
        /// Brake-cylinder pressure in another unit.
        PressureScale = 12 "pressure_scale";
        /// The gradient is right in one direction of travel and reversed in the other.
        GradientAlongTravel = 13 "gradient_along_travel";
        /// Forces that are refreshed seldom, or frozen.
        ForcesStale = 14 "forces_stale";
    }
}

impl InputFault {
    /// Returns the member with this number.
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| *fault as u8 == number)
    }

    /// Returns how much it matters: the pressure enters no balance of forces, and forces that are stale now and then are
    /// true in between.
    pub const fn severity(self) -> Severity {
        match self {
            InputFault::PressureScale | InputFault::ForcesStale => Severity::Warning,
            _ => Severity::Fundamental,
        }
    }

    /// Returns why a pipeline that is fed with it is not to be trusted.
    pub const fn reason(self) -> Reason {
        match self.dimension() {
            Dimension::Mass => Reason::ImplausibleMass,
            Dimension::Force => Reason::ImplausibleForces,
            Dimension::Ratio => Reason::ImplausibleGradient,
            Dimension::Pressure => Reason::ImplausiblePressure,
            _ => Reason::ImplausibleMotion,
        }
    }

    /// Returns whether the fault spoils the estimates of a kind of pipeline: pressure matters for brakes only.
    pub const fn concerns(self, kind: PipelineKind) -> bool {
        use PipelineKind::*;
        match self {
            InputFault::PressureScale => matches!(
                kind,
                AdhesionEm
                    | AdhesionEkf
                    | AdhesionSmoother
                    | AdhesionLaw
                    | BrakeEm
                    | BrakeEkf
                    | BrakeSmoother
                    | ResidualMonitor
            ),
            _ => true,
        }
    }

    /// Returns the dimension of the quantity's units.
    pub const fn dimension(self) -> Dimension {
        use InputFault::*;
        match self {
            TimeScale => Dimension::Time,
            SpeedScale => Dimension::Speed,
            PositionScale | DirectionReversed => Dimension::Length,
            MassScale => Dimension::Mass,
            ForcesSwapped | ForcesScale | TractionScale | BrakeScale | ForcesStale => {
                Dimension::Force
            }
            GradientSign | GradientScale | GradientAlongTravel => Dimension::Ratio,
            PressureScale => Dimension::Pressure,
        }
    }

    /// Returns how well two units of the quantity explain a factor of reported over true: the logarithm of
    /// the rest, for the nearest two; `None` where none is near.
    pub fn misfit(self, factor: f64) -> Option<f64> {
        let pairs = Unit::usual_of(self.dimension()).flat_map(|of| {
            Unit::usual_of(self.dimension()).map(move |read_as| read_as.in_terms_of(&of))
        });
        pairs
            .filter(|&pair| pair != 1.0)
            .map(|pair| (factor / pair).abs().ln().abs())
            .filter(|misfit| *misfit < UNIT_TOLERANCE)
            .reduce(f64::min)
    }
}

/// An input fault with its size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DetectedFault {
    /// Kind of the fault.
    pub fault: InputFault,
    /// Reported over true value, as far as the samples show.
    pub factor: f64,
}

impl DetectedFault {
    /// Returns the unit that the values are in, when they were read as another and that explains the
    /// factor.
    pub fn true_unit(&self, read_as: &Unit) -> Option<Unit> {
        let misfit = |of: &Unit| (self.factor / read_as.in_terms_of(of)).abs().ln().abs();
        Unit::usual_of(self.fault.dimension())
            .filter(|of| of.name() != read_as.name() && misfit(of) < UNIT_TOLERANCE)
            .min_by(|one, other| misfit(one).total_cmp(&misfit(other)))
    }
}

impl DetectedFault {
    /// Returns the detected fault in words; `read_as` is the unit that the quantity was read in.
    pub fn words(&self, read_as: &Unit) -> String {
        self.words_for((self.factor, self.factor), read_as)
    }

    /// Returns whether the forces may as well be right and the mass wrong.
    fn may_be_mass(&self) -> bool {
        self.fault == InputFault::ForcesScale && self.factor.ln().abs() < MASS_FACTOR_MAX.ln()
    }

    /// Returns the same for factors of several runs, from the lowest to the highest.
    pub fn words_for(&self, (low, high): (f64, f64), read_as: &Unit) -> String {
        let size = size(low, high);
        let what = match self.fault {
            InputFault::TimeScale => format!("times look {size} by speed, position and forces"),
            InputFault::SpeedScale if high < STUCK_FACTOR => {
                return "the speed stays near 0 while the position runs on: is its sensor or column \
                        right?"
                    .into();
            }
            InputFault::SpeedScale => {
                format!("speeds look {size} by position or acceleration")
            }
            InputFault::PositionScale if high < STUCK_FACTOR => {
                return "the position stands still while the train moves: is its sensor or column \
                        right?"
                    .into();
            }
            InputFault::PositionScale => format!("positions look {size} by the speed"),
            InputFault::DirectionReversed => {
                return "the position runs against the stated direction: is the sign of direction \
                        right, and does the chainage grow the way it is taken to?"
                    .into();
            }
            InputFault::MassScale => format!("the mass looks {size}"),
            InputFault::ForcesSwapped => {
                return "the train slows down under traction and speeds up under the brake: are \
                        traction and brake exchanged, or is the sign of control_force reversed?"
                    .into();
            }
            InputFault::ForcesScale => format!("forces look {size} for how the train accelerates"),
            InputFault::TractionScale | InputFault::BrakeScale => {
                let force =
                    if self.fault == InputFault::TractionScale { "traction" } else { "brake" };
                if self.factor < 0.0 {
                    return format!(
                        "the {force} force acts against what it is for: is its sign or column \
                         right?"
                    );
                }
                format!("the {force} force looks {size} for how the train accelerates")
            }
            InputFault::GradientSign => {
                return "the train speeds up where the gradient climbs: is the sign of the \
                        gradient or of direction right?"
                    .into();
            }
            InputFault::ForcesStale => {
                return "the train goes to its next force before that is reported: are the forces refreshed \
                        too seldom, or frozen?"
                    .into();
            }
            InputFault::GradientAlongTravel => {
                return "the gradient is right in one direction of travel and reversed in the other: is \
                        it given along the travel, not along the chainage?"
                    .into();
            }
            InputFault::GradientScale => {
                format!("gradients look {size} for how the train accelerates")
            }
            InputFault::PressureScale => {
                format!("the brake-cylinder pressure looks {size} for a brake that is applied")
            }
        };
        let question = match self.true_unit(read_as) {
            Some(unit) => format!("is the unit {} and not {}", unit.name(), read_as.name()),
            None => format!("is the unit {} right", read_as.name()),
        };
        let or_mass = if self.may_be_mass() { ", or the mass wrong" } else { "" };
        format!("{what}: {question}{or_mass}?")
    }
}

impl fmt::Display for DetectedFault {
    /// In words, for a quantity read in the unit that samples hold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dimension = self.fault.dimension();
        let permille = Unit::find(dimension, "permille");
        f.write_str(&self.words(&permille.unwrap_or_else(|| Unit::base_of(dimension))))
    }
}

/// By how much something is too large or too small.
fn size(low: f64, high: f64) -> String {
    let (low, high, word) =
        if high < 1.0 { (1.0 / high, 1.0 / low, "small") } else { (low, high, "large") };
    let shown = |value: f64| match value {
        ..10.0 => format!("{value:.1}"),
        ..1e6 => format!("{value:.0}"),
        _ => format!("{value:.1e}"),
    };
    let (low, high) = (shown(low), shown(high));
    if low == high {
        format!("{low} times too {word}")
    } else {
        format!("{low} to {high} times too {word}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lead_back_to_the_input_fault_and_names_are_unique() {
        for fault in InputFault::ALL {
            assert_eq!(InputFault::from_number(fault as u8), Some(fault));
            assert_eq!(
                InputFault::ALL.iter().filter(|other| other.name() == fault.name()).count(),
                1
            );
        }
        assert_eq!(InputFault::from_number(0), None);
    }

    #[test]
    fn the_unit_is_named_that_explains_the_factor() {
        let unit = |fault: InputFault, factor, read_as| {
            let read_as = Unit::find(fault.dimension(), read_as).unwrap();
            DetectedFault { fault, factor }.true_unit(&read_as).map(|unit| unit.name())
        };
        assert_eq!(unit(InputFault::ForcesScale, 0.001, "N"), Some("kN"));
        assert_eq!(unit(InputFault::ForcesScale, 1010.0, "kN"), Some("N"));
        assert_eq!(unit(InputFault::ForcesScale, 0.225, "N"), Some("lbf"));
        assert_eq!(unit(InputFault::SpeedScale, 3.6, "m/s"), Some("km/h"));
        assert_eq!(unit(InputFault::GradientScale, 0.1, "permille"), Some("%"));
        assert_eq!(unit(InputFault::ForcesScale, 50.0, "N"), None);
        let fault = DetectedFault { fault: InputFault::ForcesScale, factor: 0.25 };
        let newtons = Unit::find(Dimension::Force, "N").unwrap();
        assert_eq!(
            fault.words(&newtons),
            "forces look 4.0 times too small for how the train accelerates: is the unit lbf and not N, \
             or the mass wrong?"
        );
    }
}
