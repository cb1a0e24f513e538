//! What looks like a mistake in a run, or should be known before its results are believed.

use serde::Serialize;

use super::finding_unit::{read_as, unit_of};
use super::forces::{Force, ForceSource};
use super::motion::PositionSource;
use super::quality::RunQuality;
use super::quantity::Quantity;
use super::resolved::{Context, GradientSource, Resolved};
use crate::plausibility::{Finding, Findings, Severity, Slip};
use crate::train::Drive;

/// Below this distance in m, comparisons of position and speed say nothing.
const DISTANCE_MIN_M: f64 = 200.0;
/// Rows at either end that tell where a run begins and ends.
const END_ROWS: usize = 5;
/// Position and integrated speed may differ by this share: wheel wear, balises, gaps.
const DISTANCE_TOLERANCE: f64 = 0.05;
/// So far in m off the line's ends a train's end may be.
const LINE_TOLERANCE_M: f64 = 50.0;
/// Median time steps in s of recordings that make sense.
const USUAL_STEP_S: (f64, f64) = (0.0005, 60.0);

/// A moving train's columns that all keep their values for so many s are remarked on.
const STANDS_STILL_MIN_S: f64 = 10.0;
/// The speed in m/s from which a train surely moves.
const MOVING_MPS: f64 = 1.0;

/// A remark on a run.
#[derive(Clone, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "remark", rename_all = "snake_case")]
pub enum Remark {
    /// The samples cannot be true: a wrong unit, an exchange, a wrong sign.
    #[error("{}", finding.words(&unit_of(*finding, read_as)))]
    Slip {
        /// What it is, and by how much.
        #[serde(flatten)]
        finding: Finding,
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
         speed, {efficiency} of it{}; explain tells the efficiency{}",
        if *is_declared { "" } else { " as usual, since no efficiency is declared" },
        if *is_brake {
            "; the brake force is what the drive feeds back, so that --traction-only is needed where \
             a friction brake acts beside it"
        } else {
            ""
        }
    )]
    ForceByPower {
        /// The efficiency that is reckoned with.
        efficiency: f64,
        /// Whether it is declared.
        is_declared: bool,
        /// Speed in m/s below which no force is told.
        speed_min_mps: f64,
        /// Whether the brake force comes from power too, and from nothing else.
        is_brake: bool,
    },
    /// Nothing tells the gradient.
    #[error(
        "the gradient is unknown: there is no gradient in the track, no gradient, specific_force \
         or altitude in the columns"
    )]
    GradientUnknown,
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

impl Remark {
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
            Remark::Slip { finding, .. } => (finding.slip.code(), finding.slip.severity()),
            Remark::AgainstDirection { .. } => ("against_direction", Fundamental),
            Remark::DistanceMismatch { .. } => ("distance_mismatch", Warning),
            Remark::OffTheLine { .. } => ("off_the_line", Warning),
            Remark::StartUnknown => ("start_unknown", Info),
            Remark::NegativeForce { .. } => ("negative_force", Warning),
            Remark::NegativeSpeed { .. } => ("negative_speed", Warning),
            Remark::HandleOutOfRange { .. } => ("handle_out_of_range", Warning),
            Remark::UnusedHandle { .. } => ("unused_handle", Info),
            Remark::ForceNotRecorded { .. } => ("force_not_recorded", Info),
            Remark::ForceByPower { .. } => ("force_by_power", Info),
            Remark::GradientUnknown => ("gradient_unknown", Info),
            Remark::UnusualStep { .. } => ("unusual_step", Warning),
            Remark::NoValues { .. } => ("no_values", Info),
            Remark::NeverMoves { .. } => ("never_moves", Warning),
            Remark::OneRow => ("one_row", Warning),
            Remark::StandsStill { .. } => ("stands_still", Warning),
            Remark::Implausible { .. } => ("implausible", Warning),
        }
    }
}

/// Looks for what may be wrong with a run.
pub(super) fn remarks(
    context: Context,
    run: &Resolved,
    quality: &RunQuality,
    findings: &Findings,
) -> Vec<Remark> {
    let slip = |finding| Remark::Slip { finding, read_as: read_as(context.manifest, finding) };
    let mut remarks: Vec<Remark> = findings.iter().map(slip).collect();
    of_time(quality, &mut remarks);
    of_content(context, run, quality, &mut remarks);
    remarks.extend(stands_still(run));
    of_position(context, run, quality, findings, &mut remarks);
    if run.speeds.negative > 0 {
        remarks.push(Remark::NegativeSpeed { count: run.speeds.negative });
    }
    let handles = (Quantity::TractionHandle, Quantity::BrakeHandle);
    of_force(run, &run.forces.traction, Quantity::TractionForce, handles.0, &mut remarks);
    of_force(run, &run.forces.brake, Quantity::BrakeForce, handles.1, &mut remarks);
    if run.forces.traction.source == ForceSource::Power {
        let declared = context.train.drive;
        let drive = declared.unwrap_or(Drive::USUAL);
        let has_friction = context.train.brake_gear.friction_brake.is_some()
            && run.table.filled(Quantity::BrakeCylinderPressure).is_some();
        remarks.push(Remark::ForceByPower {
            efficiency: drive.efficiency,
            is_declared: declared.is_some(),
            speed_min_mps: drive.speed_min_mps,
            is_brake: run.forces.brake.source == ForceSource::Power && !has_friction,
        });
    }
    if run.gradient_source == GradientSource::Unknown {
        remarks.push(Remark::GradientUnknown);
    }
    of_plausibility(run, &mut remarks);
    remarks
}

fn of_time(quality: &RunQuality, remarks: &mut Vec<Remark>) {
    let step_s = quality.order.step_s;
    if step_s > 0.0 && !(USUAL_STEP_S.0..=USUAL_STEP_S.1).contains(&step_s) {
        remarks.push(Remark::UnusualStep { step_s });
    }
}

/// What a run lacks altogether.
fn of_content(context: Context, run: &Resolved, quality: &RunQuality, remarks: &mut Vec<Remark>) {
    let quantities = context.manifest.columns.iter().map(|mapping| mapping.quantity);
    let empty = quantities.filter(|&quantity| run.table.filled(quantity).is_none());
    remarks.extend(empty.map(|quantity| Remark::NoValues { quantity }));
    if run.order.in_order.iter().filter(|&&mark| mark).count() < 2 {
        remarks.push(Remark::OneRow);
    } else if let Some((_, highest_mps)) = quality.speed_range_mps
        && highest_mps < MOVING_MPS
    {
        remarks.push(Remark::NeverMoves { highest_mps });
    }
}

/// The longest stretch of a moving train in which no column but the time changes.
fn stands_still(run: &Resolved) -> Option<Remark> {
    let columns: Vec<&[f64]> = run
        .table
        .columns()
        .filter(|(quantity, _)| *quantity != Quantity::Time)
        .map(|(_, values)| values)
        .collect();
    let same = |one: f64, other: f64| one == other || (one.is_nan() && other.is_nan());
    let repeats = |row: usize| columns.iter().all(|values| same(values[row], values[row - 1]));
    let mut longest: Option<(f64, usize)> = None;
    let mut start = 0;
    for row in 1..run.times_s.len() {
        if !repeats(row) {
            start = row;
        }
        let for_s = run.times_s[row] - run.times_s[start];
        let moves = run.speeds.speed_mps[row] >= MOVING_MPS;
        if moves && for_s >= STANDS_STILL_MIN_S && longest.is_none_or(|(most, _)| for_s > most) {
            longest = Some((for_s, start));
        }
    }
    let (for_s, start) = longest?;
    let (from_s, speed_mps) = (run.times_s[start], run.speeds.speed_mps[start]);
    Some(Remark::StandsStill { from_s, for_s, speed_mps })
}

fn of_position(
    context: Context,
    run: &Resolved,
    quality: &RunQuality,
    findings: &Findings,
    remarks: &mut Vec<Remark>,
) {
    if run.position_source == PositionSource::IntegratedSpeed {
        if context.track.is_some() && run.entry.start_m.is_none() {
            remarks.push(Remark::StartUnknown);
        }
        return;
    }
    let ordered = |row: &usize| run.order.in_order[*row] && !run.position_m[*row].is_nan();
    let rows: Vec<usize> = (0..run.position_m.len()).filter(ordered).collect();
    if rows.len() < 2 {
        return;
    }
    // The medians of a few rows, since a row at an end may be an outlier; of so few that the way
    // between them is the run's.
    let few = END_ROWS.min(rows.len() / 100).max(1);
    let median_m = |rows: &[usize]| {
        let mut positions: Vec<f64> = rows.iter().map(|&row| run.position_m[row]).collect();
        positions.sort_by(f64::total_cmp);
        positions[(positions.len() - 1) / 2]
    };
    let net_m = median_m(&rows[rows.len() - few..]) - median_m(&rows[..few]);
    let direction = run.entry.direction;
    let is_told = |slips: &[Slip]| findings.iter().any(|finding| slips.contains(&finding.slip));
    if net_m * f64::from(direction) < -DISTANCE_MIN_M && !is_told(&[Slip::DirectionReversed]) {
        remarks.push(Remark::AgainstDirection { direction, net_m });
    }
    let (position_m, speed_m) = (net_m.abs(), quality.distance_m);
    let is_long = position_m.max(speed_m) > DISTANCE_MIN_M;
    let is_mismatch_told = is_told(&[Slip::TimeScale, Slip::SpeedScale, Slip::PositionScale]);
    if !is_mismatch_told
        && is_long
        && (position_m - speed_m).abs() > DISTANCE_TOLERANCE * position_m.max(speed_m)
    {
        remarks.push(Remark::DistanceMismatch { position_m, speed_m });
    }
    let length_m = context.track.and_then(|track| track.length_m);
    // A train may stop with its head at the line's end and its centre half a length outside.
    let beyond_m = LINE_TOLERANCE_M + 0.5 * context.train.length_m;
    if let (Some(length_m), Some((from_m, to_m))) = (length_m, quality.position_range_m)
        && (from_m < -beyond_m || to_m > length_m + beyond_m)
    {
        remarks.push(Remark::OffTheLine { from_m, to_m, length_m });
    }
}

fn of_force(
    run: &Resolved,
    force: &Force,
    quantity: Quantity,
    handle: Quantity,
    remarks: &mut Vec<Remark>,
) {
    if force.negative > 0 {
        let lowest_n = force.force_n.iter().copied().fold(f64::INFINITY, f64::min);
        remarks.push(Remark::NegativeForce { quantity, count: force.negative, lowest_n });
    }
    if force.handle_out_of_range > 0 {
        let column = run.table.column(handle).unwrap_or_default();
        let lowest = column.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let count = force.handle_out_of_range;
        remarks.push(Remark::HandleOutOfRange { quantity: handle, count, lowest, highest });
    }
    if force.source == ForceSource::Column && run.table.column(handle).is_some() {
        remarks.push(Remark::UnusedHandle { quantity: handle });
    }
    if force.source == ForceSource::None {
        remarks.push(Remark::ForceNotRecorded { quantity });
    }
}

/// The bounds beyond which [`crate::validation::Validator`] refuses a sample.
const PLAUSIBLE: [(Quantity, f64, f64); 7] = [
    (Quantity::Acceleration, -20.0, 20.0),
    (Quantity::SpecificForce, -20.0, 20.0),
    (Quantity::BrakeCylinderPressure, -5e4, 2e6),
    (Quantity::AmbientTemperature, -80.0, 80.0),
    (Quantity::Gradient, -150.0, 150.0),
    (Quantity::Latitude, -90.0, 90.0),
    (Quantity::Longitude, -180.0, 180.0),
];

fn of_plausibility(run: &Resolved, remarks: &mut Vec<Remark>) {
    for (quantity, low, high) in PLAUSIBLE {
        let Some(column) = run.table.column(quantity) else { continue };
        let is_outside = |value: &&f64| !value.is_nan() && !(low..=high).contains(*value);
        let count = column.iter().filter(is_outside).count();
        if count > 0 {
            let unit = quantity.unit().name();
            remarks.push(Remark::Implausible { quantity, count, low, high, unit });
        }
    }
}
