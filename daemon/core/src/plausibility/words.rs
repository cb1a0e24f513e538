//! A detected fault in a sentence.

use std::fmt;

use dynocar_model::units::{Dimension, Unit};

use super::input_fault::{DetectedFault, InputFault};

impl DetectedFault {
    /// The detected fault in words; `read_as` is the unit that the quantity was read in.
    pub fn words(&self, read_as: &Unit) -> String {
        self.words_for((self.factor, self.factor), read_as)
    }

    /// The same for factors of several runs, from the lowest to the highest.
    pub fn words_for(&self, (low, high): (f64, f64), read_as: &Unit) -> String {
        let size = size(low, high);
        let what = match self.fault {
            InputFault::TimeScale => format!("times look {size} by speed, position and forces"),
            InputFault::SpeedScale => {
                format!("speeds look {size} by position or acceleration")
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
            InputFault::GradientScale => {
                format!("gradients look {size} for how the train accelerates")
            }
            InputFault::PressureScale => {
                format!("the brake-cylinder pressure looks {size} for a brake that is applied")
            }
        };
        match self.true_unit(read_as) {
            Some(unit) => {
                format!("{what}: is the unit {} and not {}?", unit.name(), read_as.name())
            }
            None => format!("{what}: is the unit {} right?", read_as.name()),
        }
    }
}

impl fmt::Display for DetectedFault {
    /// In words, for a quantity read in the unit that samples hold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let base = match self.fault.dimension() {
            Dimension::Ratio => Unit::find(Dimension::Ratio, "permille"),
            dimension => Some(Unit::base_of(dimension)),
        };
        f.write_str(&self.words(&base.unwrap_or_else(|| Unit::base_of(self.fault.dimension()))))
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
