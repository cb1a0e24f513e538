//! What looks like a mistake in a run, or should be known before its results are believed.

use dynocar_core::plausibility::{DetectedFault, Severity};
use serde::Serialize;

use super::fault_unit::unit_of;
use super::quantity::Quantity;

/// A diagnostic on a run.
#[derive(Clone, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "remark", rename_all = "snake_case")]
pub enum Diagnostic {
    /// The samples cannot be true: a wrong unit, an exchange, a wrong sign.
    #[error("{}", detected.words(&unit_of(*detected, read_as)))]
    InputFault {
        /// What it is, and by how much.
        #[serde(flatten)]
        detected: DetectedFault,
        /// The unit that the quantity was read in.
        read_as: &'static str,
    },
    /// The chainage runs against the declared direction.
    #[error("the position changes by {net_m:.0} m in all, against direction = {direction}")]
    AgainstDirection {
        /// The declared direction.
        direction: i8,
        /// Change of the chainage in m from the first to the last row.
        net_m: f64,
    },
    /// Position and integrated speed disagree.
    #[error(
        "the position covers {position_m:.0} m, the integrated speed {speed_m:.0} m (ratio \
         {:.3}): are the units of time, position and speed right?",
        position_m / speed_m
    )]
    DistanceMismatch {
        /// Distance in m by the position.
        position_m: f64,
        /// Distance in m by the speed.
        speed_m: f64,
    },
    /// Positions beyond the ends of the line.
    #[error("positions from {from_m:.0} m to {to_m:.0} m leave the line, 0 m to {length_m:.0} m")]
    OffTheLine {
        /// Lowest chainage in m.
        from_m: f64,
        /// Highest chainage in m.
        to_m: f64,
        /// Length of the line in m.
        length_m: f64,
    },
    /// The position is integrated from an unknown start although the line is known.
    #[error(
        "no position is recorded: it is integrated from 0 m; give the run's start_m to place it \
         on the line"
    )]
    StartUnknown,
    /// A force that may not be negative is, by more than noise.
    #[error(
        "{quantity} is below zero in {count} rows, down to {lowest_n:.0} N, and those samples are \
         refused: a signed force is a control_force, a negative retarding one needs scale = -1"
    )]
    NegativeForce {
        /// The quantity.
        quantity: Quantity,
        /// In how many rows.
        count: usize,
        /// The lowest in N.
        lowest_n: f64,
    },
    /// The speed is negative by more than noise.
    #[error(
        "the speed is below zero in {count} rows, and those samples are refused: speed counts in \
         the direction of travel, whatever the chainage does"
    )]
    NegativeSpeed {
        /// In how many rows.
        count: usize,
    },
    /// Handles outside 0 to 1.
    #[error(
        "{quantity} lies outside 0 to 1 in {count} rows, from {lowest} to {highest}; there it \
         counts as missing{}", if *highest > 2.0 { ": is the unit '%'?" } else { "" }
    )]
    HandleOutOfRange {
        /// The quantity.
        quantity: Quantity,
        /// In how many rows.
        count: usize,
        /// The lowest.
        lowest: f64,
        /// The highest.
        highest: f64,
    },
    /// A handle is mapped besides the force itself.
    #[error("{quantity} is not used, since the force itself is mapped")]
    UnusedHandle {
        /// The quantity.
        quantity: Quantity,
    },
    /// A force is not recorded, so that no balance of forces can be formed.
    #[error("no {quantity} is mapped: without it the balance of forces is not known")]
    ForceNotRecorded {
        /// The quantity.
        quantity: Quantity,
    },
    /// The force comes from power.
    #[error(
        "no traction_force is mapped: above {speed_min_mps} m/s it is the power of the drive over the \
         speed, {efficiency} of it{}; explain estimates the efficiency{}",
        if *is_declared { "" } else { " as usual, since no efficiency is declared" },
        if *is_brake {
            "; the brake force is what the drive feeds back, so that --traction-only is needed where \
             a friction brake acts in addition to it"
        } else {
            ""
        }
    )]
    ForceByPower {
        /// The efficiency that is assumed.
        efficiency: f64,
        /// Whether it is declared.
        is_declared: bool,
        /// Speed in m/s below which no force is estimated.
        speed_min_mps: f64,
        /// Whether the brake force comes from power too, and from nothing else.
        is_brake: bool,
    },
    /// Nothing gives the gradient.
    #[error(
        "the gradient is unknown: there is no gradient in the track, no gradient, specific_force \
         or altitude in the columns"
    )]
    GradientUnknown,
    /// The file ends within a line.
    #[error("the file breaks off within its last line, which is not used")]
    BreaksOff,
    /// A step of time that no recording has.
    #[error("the median time step is {step_s} s: is the unit of time right?")]
    UnusualStep {
        /// The median step in s.
        step_s: f64,
    },
    /// The recording keeps repeating itself while the train moves.
    #[error(
        "from {from_s} s every column but the time keeps its value for {for_s:.1} s, at \
         {speed_mps:.1} m/s: unless the data are free of noise, the recorder hung, and the file \
         should end there"
    )]
    StandsStill {
        /// When it begins, as in the file.
        from_s: f64,
        /// How long it lasts.
        for_s: f64,
        /// The speed in m/s that is repeated.
        speed_mps: f64,
    },
    /// A column without a single value.
    #[error("{quantity} is mapped, but no row has a value of it")]
    NoValues {
        /// The quantity.
        quantity: Quantity,
    },
    /// The train stands all the time.
    #[error(
        "the train hardly moves, at {highest_mps} m/s at most: nothing can be learned; is the unit \
         of speed right?"
    )]
    NeverMoves {
        /// The highest speed in m/s.
        highest_mps: f64,
    },
    /// No two rows follow each other in time.
    #[error("only one row is in order of time: motion cannot be seen in it")]
    OneRow,
    /// Values outside what the quantity can be on a railway.
    #[error(
        "{quantity} lies outside {low} to {high} {unit} in {count} rows, and those samples are \
         refused: is the unit right?"
    )]
    Implausible {
        /// The quantity.
        quantity: Quantity,
        /// In how many rows.
        count: usize,
        /// Lowest plausible value.
        low: f64,
        /// Highest plausible value.
        high: f64,
        /// Unit of the bounds.
        unit: &'static str,
    },
}

impl Diagnostic {
    /// The name for machines.
    pub const fn code(&self) -> &'static str {
        self.code_and_severity().0
    }

    /// How much it matters.
    pub const fn severity(&self) -> Severity {
        self.code_and_severity().1
    }

    const fn code_and_severity(&self) -> (&'static str, Severity) {
        use Severity::{Fundamental, Info, Warning};
        match self {
            Diagnostic::InputFault { detected, .. } => {
                (detected.fault.name(), detected.fault.severity())
            }
            Diagnostic::AgainstDirection { .. } => ("against_direction", Fundamental),
            Diagnostic::DistanceMismatch { .. } => ("distance_mismatch", Warning),
            Diagnostic::OffTheLine { .. } => ("off_the_line", Warning),
            Diagnostic::StartUnknown => ("start_unknown", Info),
            Diagnostic::NegativeForce { .. } => ("negative_force", Warning),
            Diagnostic::NegativeSpeed { .. } => ("negative_speed", Warning),
            Diagnostic::HandleOutOfRange { .. } => ("handle_out_of_range", Warning),
            Diagnostic::UnusedHandle { .. } => ("unused_handle", Info),
            Diagnostic::ForceNotRecorded { .. } => ("force_not_recorded", Info),
            Diagnostic::ForceByPower { .. } => ("force_by_power", Info),
            Diagnostic::GradientUnknown => ("gradient_unknown", Info),
            Diagnostic::BreaksOff => ("breaks_off", Warning),
            Diagnostic::UnusualStep { .. } => ("unusual_step", Warning),
            Diagnostic::NoValues { .. } => ("no_values", Info),
            Diagnostic::NeverMoves { .. } => ("never_moves", Warning),
            Diagnostic::OneRow => ("one_row", Warning),
            Diagnostic::StandsStill { .. } => ("stands_still", Warning),
            Diagnostic::Implausible { .. } => ("implausible", Warning),
        }
    }
}
