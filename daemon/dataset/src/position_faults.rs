//! Faults of a run's positions: against the declared direction, the speed and the line.

use dynocar_core::plausibility::Severity::{Fundamental, Info, Warning};
use dynocar_core::plausibility::{DetectedFaults, InputFault};
use toml::Value;

use super::chainage;
use super::diagnostic::Diagnostic;
use super::keys::run::DIRECTION;
use super::order::pairs;
use super::quality::{RunQuality, distance_m};
use super::resolved::{Context, Resolved};
use super::speed_and_position::{DISTANCE_MIN_M, PositionSource, turn};

/// Number of rows at either end that show where a run begins and ends.
const END_ROWS: usize = 5;
/// Greatest relative difference between position and integrated speed, by wheel wear, balises and gaps.
const DISTANCE_TOLERANCE: f64 = 0.05;
/// Distance in m beyond the line's ends within which a train's end may be.
const LINE_TOLERANCE_M: f64 = 50.0;
/// Over a longer time in s, and in usual steps, the speed does not show the way.
const PAUSE_S: f64 = 10.0;
const PAUSE_STEPS: f64 = 3.0;

/// Adds the diagnostics of a run's positions.
pub(super) fn of_position(
    context: Context,
    run: &Resolved,
    quality: &RunQuality,
    detected: &DetectedFaults,
    diagnostics: &mut Vec<Diagnostic>,
) {
    if run.position_source == PositionSource::IntegratedSpeed {
        if context.track.is_some() && run.entry.start_m.is_none() {
            let text = "no position is recorded: it is integrated from 0 m; give the run's start_m \
                        to place it on the line";
            diagnostics.push(Diagnostic::new("start_unknown", Info, text, []));
        }
        of_line(context, quality, diagnostics);
        return;
    }
    let rows = run.order.rows().filter(|row| !run.position_m[*row].is_nan());
    let count = rows.clone().count();
    let (Some(first_row), Some(last_row)) = (rows.clone().next(), rows.clone().next_back()) else {
        return;
    };
    if count < 2 {
        return;
    }
    let positions = rows.map(|row| run.position_m[row]);
    // The medians of a few rows, since a row at an end may be an outlier; of so few that the way
    // between them is the run's.
    let few = END_ROWS.min(count / 100).max(1);
    let median_m = |mut positions: Vec<f64>| {
        positions.sort_by(f64::total_cmp);
        positions[(positions.len() - 1) / 2]
    };
    let (first, last) = (positions.clone().take(few), positions.clone().rev().take(few));
    let (first_m, last_m) = (median_m(first.collect()), median_m(last.collect()));
    let breaks = breaks(run);
    let net_m = last_m - first_m - breaks.iter().map(|it| it.1).sum::<f64>();
    diagnostics.extend(of_breaks(run, &breaks));
    let direction = run.entry.direction;
    let is_reported =
        |faults: &[InputFault]| detected.iter().any(|detected| faults.contains(&detected.fault));
    if net_m * f64::from(direction) < -DISTANCE_MIN_M
        && !is_reported(&[InputFault::DirectionReversed])
    {
        let declared = DIRECTION.assign(direction);
        let text = format!("the position changes by {net_m:.0} m in all, against {declared}");
        let figures = [("direction", Value::from(direction)), ("net_m", net_m.into())];
        diagnostics.push(Diagnostic::new("against_direction", Fundamental, text, figures));
    }
    let ways_m = (net_m.abs(), distance_m(run, first_row..=last_row));
    let turn = quality.position_range_m.and_then(|range_m| turn(range_m, [first_m, last_m]));
    let is_explained = !breaks.is_empty()
        || is_reported(&[InputFault::TimeScale, InputFault::SpeedScale, InputFault::PositionScale]);
    diagnostics.extend(of_ways(ways_m, turn, is_explained));
    of_line(context, quality, diagnostics);
}

/// Returns that a run's way in m by its positions is not that by its speed; `turn` is where it may turn, and its way
/// there and back.
fn of_ways(
    (position_m, speed_m): (f64, f64),
    turn: Option<(f64, f64)>,
    is_explained: bool,
) -> Option<Diagnostic> {
    let is_off = |position_m: f64| {
        (position_m - speed_m).abs() > DISTANCE_TOLERANCE * position_m.max(speed_m)
    };
    if !is_off(position_m) {
        return None;
    }
    if let Some((turn_m, _)) = turn.filter(|(_, there_and_back_m)| !is_off(*there_and_back_m)) {
        let text = format!(
            "the train goes to {turn_m:.0} m and back, but a run has one direction: make a file of \
             each way, with its own direction"
        );
        return Some(Diagnostic::new("turns_back", Warning, text, [("turn_m", turn_m.into())]));
    }
    if is_explained || position_m.max(speed_m) <= DISTANCE_MIN_M {
        return None;
    }
    let text = format!(
        "the position covers {position_m:.0} m, the integrated speed {speed_m:.0} m (ratio {:.3}): are the units of \
         time, position and speed right?",
        position_m / speed_m
    );
    let figures = [("position_m", position_m.into()), ("speed_m", speed_m.into())];
    Some(Diagnostic::new("distance_mismatch", Warning, text, figures))
}

/// Returns where the chainage breaks: each row after it, and by how much in m the chainage grows there in addition to
/// the way of the train.
fn breaks(run: &Resolved) -> Vec<(usize, f64)> {
    let (speeds, direction) = (&run.speeds, f64::from(run.entry.direction));
    let is_good = |row: &usize| {
        let is_there = !run.position_m[*row].is_nan() && !speeds.speed_mps[*row].is_nan();
        is_there && !speeds.is_spike[*row]
    };
    let longest_s = PAUSE_S.max(PAUSE_STEPS * run.order.counts.step_s);
    let step = |(from, to): (usize, usize)| {
        let step_s = run.times_s[to] - run.times_s[from];
        let way_m = 0.5 * (speeds.speed_mps[from] + speeds.speed_mps[to]) * step_s;
        let moved_m = direction * (run.position_m[to] - run.position_m[from]);
        (step_s <= longest_s).then_some((to, (moved_m, way_m)))
    };
    let rows = run.order.rows().filter(is_good);
    let (ends, steps_m): (Vec<usize>, Vec<(f64, f64)>) = pairs(rows).filter_map(step).unzip();
    let jump = |place: usize| {
        let (moved_m, way_m) = steps_m[place];
        (ends[place], direction * (moved_m - way_m))
    };
    chainage::breaks(&steps_m).into_iter().map(jump).collect()
}

/// Returns the diagnostic of the breaks of the chainage.
fn of_breaks(run: &Resolved, breaks: &[(usize, f64)]) -> Option<Diagnostic> {
    let (row, jump_m) = breaks.first()?;
    let (line, count) = (run.table.line(*row), breaks.len());
    let more = match count {
        1 => String::new(),
        _ => format!(", and {} times later on", count - 1),
    };
    let text = format!(
        "the position jumps by {jump_m:.0} m in line {line}{more}: if the chainage of the line has no such break, map \
         another column; the wheels are compared with the positions on either side alone"
    );
    let figures = [
        ("line", Value::Integer(line as i64)),
        ("jump_m", (*jump_m).into()),
        ("count", Value::Integer(count as i64)),
    ];
    Some(Diagnostic::new("chainage_break", Warning, text, figures))
}

/// Adds the diagnostic of positions outside the line.
fn of_line(context: Context, quality: &RunQuality, diagnostics: &mut Vec<Diagnostic>) {
    let length_m = context.track.and_then(|track| track.length_m);
    // A train may stop with its head at the line's end and its centre half a length outside.
    let beyond_m = LINE_TOLERANCE_M + 0.5 * context.train.length_m;
    if let (Some(length_m), Some((from_m, to_m))) = (length_m, quality.position_range_m)
        && (from_m < -beyond_m || to_m > length_m + beyond_m)
    {
        let text = format!(
            "positions from {from_m:.0} m to {to_m:.0} m leave the line, 0 m to {length_m:.0} m"
        );
        let figures =
            [("from_m", from_m.into()), ("to_m", to_m.into()), ("length_m", length_m.into())];
        diagnostics.push(Diagnostic::new("off_the_line", Warning, text, figures));
    }
}
