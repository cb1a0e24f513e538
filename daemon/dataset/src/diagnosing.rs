//! Search for the diagnostics of a run.

use dynocar_core::plausibility::DetectedFault;
use dynocar_core::plausibility::Severity::{Fundamental, Info, Warning};
use dynocar_model::train::PowerTrain;
use toml::Value;

use super::clock_faults::{DAY_S, HALF_DAY_S, HOUR_S};
use super::column_faults::{column_faults, stuck_columns};
use super::diagnostic::{Diagnostic, implausible_columns, read_as};
use super::force_faults::force_faults;
use super::forces::{Force, ForceSource};
use super::position_faults::of_position;
use super::quality::{Judge, RunQuality};
use super::quantity::Quantity;
use super::resolved::{Context, GradientSource, Resolved};

/// Usual median time steps in s of recordings.
const USUAL_STEP_S: (f64, f64) = (0.0005, 60.0);

/// A moving train's columns that all keep their values for this many s are diagnosed.
const STANDS_STILL_MIN_S: f64 = 10.0;
/// ... this many times longer than any other such interval.
const EXCEPTION: f64 = 3.0;
/// The speed in m/s from which a train surely moves.
const MOVING_MPS: f64 = 1.0;

/// Code of a force that no column gives.
pub const FORCE_NOT_RECORDED: &str = "force_not_recorded";

fn of(quantity: Quantity) -> (&'static str, Value) {
    ("quantity", quantity.name().into())
}

fn of_count(rows: usize) -> (&'static str, Value) {
    ("count", Value::Integer(rows as i64))
}

/// Returns the diagnostics of the likely mistakes in a run.
pub(super) fn diagnostics(
    context: Context,
    run: &Resolved,
    quality: &RunQuality,
    judge: &Judge,
) -> Vec<Diagnostic> {
    let detected = &judge.detected();
    let fault = |it: DetectedFault| Diagnostic::of_fault(it, read_as(context.manifest, it.fault));
    let mut diagnostics: Vec<Diagnostic> = detected.iter().copied().map(fault).collect();
    of_doubts(context, &mut diagnostics);
    of_clock(run, &mut diagnostics);
    of_time(quality, &mut diagnostics);
    of_content(context, run, quality, &mut diagnostics);
    diagnostics.extend(stands_still(run));
    of_position(context, run, quality, detected, &mut diagnostics);
    if run.speeds.negative > 0 {
        let count = run.speeds.negative;
        let text = format!(
            "the speed is below zero in {count} rows, and those samples are refused: speed counts in \
             the direction of travel, whatever the chainage does"
        );
        let figures = [of_count(count)];
        diagnostics.push(Diagnostic::new("negative_speed", Warning, text, figures));
    }
    let handles = (Quantity::TractionHandle, Quantity::BrakeHandle);
    of_force(run, &run.forces.traction, Quantity::TractionForce, handles.0, &mut diagnostics);
    of_force(run, &run.forces.brake, Quantity::BrakeForce, handles.1, &mut diagnostics);
    of_power(context, run, &mut diagnostics);
    if run.gradient_source == GradientSource::Unknown {
        let text = "the gradient is unknown: there is no gradient in the track, no gradient, \
                    specific_force or altitude in the columns";
        diagnostics.push(Diagnostic::new("gradient_unknown", Info, text, []));
    }
    diagnostics.extend(implausible_columns(run));
    diagnostics.extend(column_faults(run));
    diagnostics.extend(force_faults(context, run, judge.windows()));
    if detected.is_empty() {
        diagnostics.extend(stuck_columns(context, run, judge.windows()));
    }
    diagnostics
}

/// Adds the diagnostics of a force computed from power.
fn of_power(context: Context, run: &Resolved, diagnostics: &mut Vec<Diagnostic>) {
    if run.forces.traction.source != ForceSource::Power {
        return;
    }
    let declared = context.train.drive;
    let drive = declared.unwrap_or(PowerTrain::USUAL);
    let has_friction = context.train.brake_gear.friction_brake.is_some()
        && run.table.filled(Quantity::BrakeCylinderPressure).is_some();
    let is_brake = run.forces.brake.source == ForceSource::Power && !has_friction;
    let PowerTrain { efficiency, speed_min_mps, .. } = drive;
    let (of_drive, severity) = match declared {
        Some(_) => ("", Info),
        None => (
            " as usual, since no efficiency is declared: force and mass are known to a tenth of the power",
            Warning,
        ),
    };
    let of_brake = match is_brake {
        true => {
            "; the brake force is what the drive feeds back, so that --traction-only is needed where \
             a friction brake acts in addition to it"
        }
        false => "",
    };
    let text = format!(
        "no traction_force is mapped: above {speed_min_mps} m/s it is the power of the drive over the \
         speed, {efficiency} of it{of_drive}; explain estimates the efficiency{of_brake}"
    );
    let figures = [
        ("efficiency", efficiency.into()),
        ("is_declared", declared.is_some().into()),
        ("speed_min_mps", speed_min_mps.into()),
        ("is_brake", is_brake.into()),
    ];
    diagnostics.push(Diagnostic::new("force_by_power", severity, text, figures));
}

/// Adds the doubts of `init` that nobody has confirmed.
fn of_doubts(context: Context, diagnostics: &mut Vec<Diagnostic>) {
    for mapping in context.manifest.columns.iter().filter(|mapping| mapping.is_doubtful) {
        let (quantity, shown) = (mapping.quantity, mapping.shown());
        let text = format!(
            "{quantity} was DOUBTFUL when {shown} was taken for it, and nobody has confirmed it: set it \
             right in dataset.toml or delete its doubtful = true"
        );
        diagnostics.push(Diagnostic::new("doubtful_input", Warning, text, [of(quantity)]));
    }
}

/// Adds the repairs of the times, and the faults that cannot be repaired.
fn of_clock(run: &Resolved, diagnostics: &mut Vec<Diagnostic>) {
    let faults = &run.clock_faults;
    let mut jumps: Vec<(usize, f64, usize)> = Vec::new();
    for &(row, jump_s) in &faults.jumps {
        match jumps.iter_mut().find(|it| it.1 == jump_s) {
            Some((_, _, count)) => *count += 1,
            None => jumps.push((row, jump_s, 1)),
        }
    }
    for (row, jump_s, count) in jumps {
        let (line, way) = (run.table.line(row), if jump_s < 0.0 { "back" } else { "forward" });
        let cause = match -jump_s {
            HOUR_S => "summer time",
            HALF_DAY_S => "a clock of twelve hours",
            DAY_S => "seconds of the day, which begin again at midnight",
            ..0.0 => "summer time",
            _ => "a counter that begins again at 0",
        };
        let more =
            if count > 1 { format!(", and {} times later on,", count - 1) } else { "".into() };
        let text = format!(
            "the clock went {way} by {} s in line {line}{more} while the train went on: {cause}? The rows from there \
             are read as if it had not",
            jump_s.abs()
        );
        let figures = [("line", Value::Integer(line as i64)), ("jump_s", jump_s.into())];
        diagnostics.push(Diagnostic::new("clock_change", Warning, text, figures));
    }
    if let Some(rows) = faults.shared {
        let text = format!(
            "{rows} rows share each time: they are spread evenly over the time to the next; a clock with \
             fractions would tell more"
        );
        diagnostics.push(Diagnostic::new("whole_seconds", Warning, text, [of_count(rows)]));
    }
    if faults.sorted {
        let text = "the rows stood in another order than that of time: they are sorted";
        diagnostics.push(Diagnostic::new("sorted", Info, text, []));
    }
    if let Some((row, back_s)) = faults.anew {
        let line = run.table.line(row);
        let text = format!(
            "the time begins anew in line {line}, {back_s:.1} s back, and overlaps what stands before: the rows \
             from there are another run or another train, and need a file of their own"
        );
        let figures = [("line", Value::Integer(line as i64)), ("back_s", back_s.into())];
        diagnostics.push(Diagnostic::new("time_begins_anew", Fundamental, text, figures));
    }
    if run.table.lines.notes > 0 {
        let count = run.table.lines.notes;
        let text = format!("lines of words alone between or below the rows, left out: {count}");
        diagnostics.push(Diagnostic::new("notes_left_out", Info, text, [of_count(count)]));
    }
}

fn of_time(quality: &RunQuality, diagnostics: &mut Vec<Diagnostic>) {
    let step_s = quality.order.step_s;
    if step_s > 0.0 && !(USUAL_STEP_S.0..=USUAL_STEP_S.1).contains(&step_s) {
        let text = format!("the median time step is {step_s} s: is the unit of time right?");
        let figures = [("step_s", step_s.into())];
        diagnostics.push(Diagnostic::new("unusual_step", Warning, text, figures));
    }
    if quality.lines.truncated {
        let text = "the file breaks off within its last line, which is not used";
        diagnostics.push(Diagnostic::new("breaks_off", Warning, text, []));
    }
}

/// Adds the diagnostics of quantities that a run lacks altogether.
fn of_content(
    context: Context,
    run: &Resolved,
    quality: &RunQuality,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let quantities = context.manifest.columns.iter().map(|mapping| mapping.quantity);
    let empty = quantities.filter(|&quantity| run.table.filled(quantity).is_none());
    diagnostics.extend(empty.map(|quantity| {
        let text = format!("{quantity} is mapped, but no row has a value of it");
        Diagnostic::new("no_values", Info, text, [of(quantity)])
    }));
    if run.order.rows().nth(1).is_none() {
        let text = "only one row is in order of time: motion cannot be seen in it";
        diagnostics.push(Diagnostic::new("one_row", Warning, text, []));
    } else if let Some((_, highest_mps)) = quality.speed_range_mps
        && highest_mps < MOVING_MPS
    {
        let text = format!(
            "the train hardly moves, at {highest_mps} m/s at most: nothing can be learned; is the \
             unit of speed right?"
        );
        let figures = [("highest_mps", highest_mps.into())];
        diagnostics.push(Diagnostic::new("never_moves", Warning, text, figures));
    }
}

/// Returns the longest interval of a moving train in which no column but the time changes, where it is an exception:
/// coarse speeds keep their value through every cruise. A recorder that pauses with a train has not hung.
fn stands_still(run: &Resolved) -> Option<Diagnostic> {
    let columns: Vec<&[f64]> = run
        .table
        .columns()
        .filter(|(quantity, _)| *quantity != Quantity::Time)
        .map(|(_, values)| values)
        .collect();
    let same = |one: f64, other: f64| one == other || (one.is_nan() && other.is_nan());
    let repeats = |row: usize| columns.iter().all(|values| same(values[row], values[row - 1]));
    let is_pause = |row: usize| run.times_s[row] - run.times_s[row - 1] >= STANDS_STILL_MIN_S;
    let (mut longest, mut second_s, mut start) = ((0.0, 0), 0.0, 0);
    for row in 1..run.times_s.len() {
        if !repeats(row) || is_pause(row) {
            start = row;
        }
        let for_s = run.times_s[row] - run.times_s[start];
        if run.speeds.speed_mps[row] < MOVING_MPS {
            continue;
        }
        if for_s > longest.0 {
            if longest.1 != start {
                second_s = longest.0;
            }
            longest = (for_s, start);
        } else if start != longest.1 && for_s > second_s {
            second_s = for_s;
        }
    }
    let (for_s, start) = longest;
    if for_s < STANDS_STILL_MIN_S || for_s < EXCEPTION * second_s {
        return None;
    }
    let (from_s, speed_mps) = (run.times_s[start], run.speeds.speed_mps[start]);
    let text = format!(
        "from {from_s} s every column but the time keeps its value for {for_s:.1} s, at \
         {speed_mps:.1} m/s: unless the data are free of noise, the recorder hung, and the file \
         should end there"
    );
    let figures =
        [("from_s", from_s.into()), ("for_s", for_s.into()), ("speed_mps", speed_mps.into())];
    Some(Diagnostic::new("stands_still", Warning, text, figures))
}

fn of_force(
    run: &Resolved,
    force: &Force,
    quantity: Quantity,
    handle: Quantity,
    diagnostics: &mut Vec<Diagnostic>,
) {
    if force.negative > 0 {
        let lowest_n = force.force_n.iter().copied().fold(f64::INFINITY, f64::min);
        let count = force.negative;
        let text = format!(
            "{quantity} is below zero in {count} rows, down to {lowest_n:.0} N, and those samples are \
             refused: a signed force is a control_force, a negative retarding one needs scale = -1"
        );
        let figures = [of(quantity), of_count(count), ("lowest_n", lowest_n.into())];
        diagnostics.push(Diagnostic::new("negative_force", Warning, text, figures));
    }
    if force.handle_out_of_range > 0 {
        let column = run.table.column(handle).unwrap_or_default();
        let lowest = column.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let count = force.handle_out_of_range;
        let hint = if highest > 2.0 { ": is the unit '%'?" } else { "" };
        let text = format!(
            "{handle} lies outside 0 to 1 in {count} rows, from {lowest} to {highest}; there it \
             counts as missing{hint}"
        );
        let figures =
            [of(handle), of_count(count), ("lowest", lowest.into()), ("highest", highest.into())];
        diagnostics.push(Diagnostic::new("handle_out_of_range", Warning, text, figures));
    }
    if force.source == ForceSource::Column && run.table.column(handle).is_some() {
        let text = format!("{handle} is not used, since the force itself is mapped");
        diagnostics.push(Diagnostic::new("unused_handle", Info, text, [of(handle)]));
    }
    if force.source == ForceSource::None {
        let remedy = match quantity {
            Quantity::BrakeForce => "; --traction-only uses the forces under traction alone",
            _ => "",
        };
        let text = format!(
            "no {quantity} is mapped: without it the balance of forces is not known{remedy}"
        );
        diagnostics.push(Diagnostic::new(FORCE_NOT_RECORDED, Info, text, [of(quantity)]));
    }
}
