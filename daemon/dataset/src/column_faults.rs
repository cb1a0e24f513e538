//! Faults of single columns: values that are kept for part of a run, while the motion shows that they changed, fill
//! values, and radii that no track has.

use dynocar_core::plausibility::Severity::Warning;
use dynocar_core::plausibility::window_balance::WindowMean;
use dynocar_model::terms::wheel::STILL_MPS;
use toml::Value;

use super::diagnostic::Diagnostic;
use super::fill_values::FillValue;
use super::order::{pairs, quantile};
use super::quantity::Quantity;
use super::resolved::{Context, GradientSource, Resolved};
use super::speed_and_position::PositionSource;

/// A value that is kept for less than this time in s says nothing.
const KEPT_MIN_S: f64 = 20.0;
/// A longer step in s is a pause of the recorder.
const PAUSE_S: f64 = 10.0;
/// Speed in m/s from which a train surely moves.
const MOVING_MPS: f64 = 1.0;
/// A speed that was kept leaps by more than this in m/s, and by this rate in m/s², to its next value...
const LEAP: (f64, f64) = (1.0, 3.0);
/// ... or is contradicted by forces that would have changed it by this much in m/s.
const CHANGED_MPS: f64 = 3.0;
/// Acceleration in m/s² that forces leave unexplained where the gradient is known, and where it is not.
const UNEXPLAINED_MPS2: (f64, f64) = (0.1, 0.35);
/// Greatest deceleration in m/s² by the running resistance, with a margin.
const RESISTANCE_MPS2: f64 = 0.25;
/// Share of a force that has to be missing, and the least force over the mass in m/s² that can be seen to be.
const MISSING: (f64, f64) = (0.6, 0.1);
/// A force over the mass in m/s² below which it does not act.
const IDLE_MPS2: f64 = 0.01;
/// Windows of motion that have to contradict a force.
pub(super) const WINDOWS_MIN: usize = 3;
/// Length in s of a window of motion.
const WINDOW_S: f64 = 5.0;
/// Least way in m on which a position is kept, and the same in usual steps.
const KEPT_M: f64 = 200.0;
const KEPT_STEPS: f64 = 5.0;

/// Radius in m of the narrowest curve, of trams and mines.
const RADIUS_MIN_M: f64 = 10.0;

/// An interval in which a column keeps its value.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kept {
    /// First and last row.
    rows: (usize, usize),
    value: f64,
    for_s: f64,
}

/// The accelerations of a run in the windows of motion, each with the row in which it ended.
pub(super) type Windows<'w> = &'w [(usize, WindowMean)];

/// Returns the acceleration in m/s² that no recorded force explains; the resistance is a negative part of it.
fn unexplained_mps2(window: &WindowMean) -> f64 {
    let WindowMean { inertia_mps2, traction_mps2, brake_mps2, gradient_mps2, .. } = window;
    inertia_mps2 - traction_mps2 + brake_mps2 + gradient_mps2
}

fn limit_mps2(run: &Resolved) -> f64 {
    let (known, unknown) = UNEXPLAINED_MPS2;
    if run.gradient_source == GradientSource::Unknown { unknown } else { known }
}

/// Returns how the train moves without a force that is 0 in a window: by this acceleration in m/s², more than
/// resistance and gradient make.
pub(super) fn moved_mps2(run: &Resolved, quantity: Quantity, window: &WindowMean) -> Option<f64> {
    let change_mps2 = match quantity {
        Quantity::BrakeForce if window.traction_mps2 < IDLE_MPS2 => {
            -unexplained_mps2(window) - RESISTANCE_MPS2
        }
        Quantity::TractionForce if window.brake_mps2 < IDLE_MPS2 => unexplained_mps2(window),
        _ => return None,
    };
    (change_mps2 > limit_mps2(run)).then_some(change_mps2)
}

/// Returns the columns that keep their value where it must have changed.
pub(super) fn stuck_columns(context: Context, run: &Resolved, windows: Windows) -> Vec<Diagnostic> {
    let name = |quantity| context.manifest.mapping(quantity).map_or("", |it| &it.column[..]);
    let forces = [Quantity::TractionForce, Quantity::BrakeForce];
    let of_forces = forces.map(|quantity| force(run, quantity, windows).map(|it| (quantity, it)));
    let speed = speed(run, windows).map(|it| (Quantity::Speed, it));
    let position = position(run).filter(|_| speed.is_none()).map(|it| (Quantity::Position, it));
    let found = of_forces.into_iter().chain([speed, position]).flatten();
    let diagnostic = |(quantity, kept): (Quantity, Kept)| {
        let (from_s, for_s, value) = (run.times_s[kept.rows.0], kept.for_s, kept.value);
        let (column, line) = (name(quantity), run.table.line(kept.rows.0));
        let unit = quantity.unit().name();
        let text = format!(
            "column '{column}' keeps its value, {value:.1} {unit}, for {for_s:.0} s from {from_s:.1} s on (line {line}), \
             while the motion shows another {quantity}: if it hung, leave its cells there empty"
        );
        let figures = [
            ("quantity", quantity.name().into()),
            ("from_s", from_s.into()),
            ("for_s", for_s.into()),
            ("value", value.into()),
        ];
        Diagnostic::new("stuck", Warning, text, figures)
    };
    found.map(diagnostic).collect()
}

/// Returns the intervals in which a column keeps its value.
fn kept(run: &Resolved, values: &[f64]) -> Vec<Kept> {
    let mut found: Vec<Kept> = Vec::new();
    let mut from = None;
    let is_over = |(row, next): (usize, usize)| {
        values[row] != values[next] || run.times_s[next] - run.times_s[row] > PAUSE_S
    };
    for (row, next) in pairs(run.order.rows()) {
        let start = *from.get_or_insert(row);
        if is_over((row, next)) {
            from = Some(next);
            continue;
        }
        let for_s = run.times_s[next] - run.times_s[start];
        let whole = Kept { rows: (start, next), value: values[start], for_s };
        match found.last_mut().filter(|it| it.rows.0 == start) {
            Some(last) => *last = whole,
            None => found.push(whole),
        }
    }
    found.retain(|it| it.for_s >= KEPT_MIN_S);
    found
}

impl Kept {
    /// Returns the windows of motion that lie within the interval.
    fn windows<'w>(&self, run: &Resolved, windows: Windows<'w>) -> &'w [(usize, WindowMean)] {
        let from_s = run.times_s[self.rows.0] + WINDOW_S;
        let start = windows.partition_point(|(row, _)| run.times_s[*row] < from_s);
        let end = windows.partition_point(|(row, _)| *row <= self.rows.1);
        windows.get(start..end).unwrap_or_default()
    }
}

fn longest(all: impl Iterator<Item = Kept>) -> Option<Kept> {
    all.max_by(|one, other| one.for_s.total_cmp(&other.for_s))
}

/// Returns the longest interval in which a speed is kept that cannot have been the train's.
fn speed(run: &Resolved, windows: Windows) -> Option<Kept> {
    let speed_mps = &run.speeds.speed_mps;
    let next = |row: usize| (row + 1..speed_mps.len()).find(|&next| !speed_mps[next].is_nan());
    let leaps = |it: &Kept| {
        next(it.rows.1).is_some_and(|next| {
            let step_s = run.times_s[next] - run.times_s[it.rows.1];
            let change_mps = (speed_mps[next] - it.value).abs();
            step_s <= PAUSE_S && change_mps > LEAP.0 + LEAP.1 * step_s && !run.speeds.is_spike[next]
        })
    };
    let is_pushed = |it: &Kept| {
        let within = it.windows(run, windows);
        let push = |window: &WindowMean| unexplained_mps2(window) - window.inertia_mps2;
        let mut pushes: Vec<f64> = within.iter().map(|(_, window)| push(window)).collect();
        let Some(middle) = quantile(&mut pushes, 0.5) else { return false };
        let sum = pushes.iter().map(|push| (push - middle).abs()).sum::<f64>();
        sum > limit_mps2(run) * pushes.len() as f64 && WINDOW_S * sum > CHANGED_MPS
    };
    let all = kept(run, speed_mps).into_iter().filter(|it| it.value >= MOVING_MPS);
    longest(all.filter(|it| leaps(it) || is_pushed(it)))
}

/// Returns the acceleration in m/s² by the other one of the two forces.
fn other_mps2(quantity: Quantity, window: &WindowMean) -> f64 {
    match quantity {
        Quantity::BrakeForce => window.traction_mps2,
        _ => window.brake_mps2,
    }
}

/// Returns the longest interval in which a force is kept that the accelerations contradict, and they do so nowhere
/// else.
fn force(run: &Resolved, quantity: Quantity, windows: Windows) -> Option<Kept> {
    let forces = &run.forces;
    let force = if quantity == Quantity::BrakeForce { &forces.brake } else { &forces.traction };
    let limit = limit_mps2(run);
    let is_contradicted = |(_, window): &(usize, WindowMean)| {
        let unexplained = unexplained_mps2(window);
        let is_brake = quantity == Quantity::BrakeForce;
        let own = if is_brake { window.brake_mps2 } else { window.traction_mps2 };
        let missing = limit.max(MISSING.0 * own);
        let resistance = RESISTANCE_MPS2;
        let [more, less] = match is_brake {
            false => [unexplained > missing, unexplained < -missing - resistance],
            true => [unexplained < -missing - resistance, unexplained > missing],
        };
        other_mps2(quantity, window) < IDLE_MPS2
            && window.speed_mps > STILL_MPS
            && (more || own > MISSING.1 && less)
    };
    let count = |it: &[(usize, WindowMean)]| it.iter().filter(|it| is_contradicted(it)).count();
    // A force that is 0 in all rows was not recorded.
    let is_part = |it: &Kept| it.value != 0.0 || it.rows.1 - it.rows.0 + 2 < force.force_n.len();
    let all = kept(run, &force.force_n).into_iter().filter(is_part);
    // With another mass than the declared one a force acts otherwise all along.
    let varies = |it: &[(usize, WindowMean)]| {
        let clear = it.iter().filter(|it| other_mps2(quantity, &it.1) < IDLE_MPS2);
        let unexplained = clear.map(|it| unexplained_mps2(&it.1));
        let (low, high) = unexplained
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| {
                (it.min(low), it.max(high))
            });
        high - low > limit
    };
    let is_stuck = |it: &Kept| {
        let within = it.windows(run, windows);
        count(within) >= WINDOWS_MIN && (it.value == 0.0 || varies(within))
    };
    let stuck: Vec<Kept> = all.filter(is_stuck).collect();
    let within: usize = stuck.iter().map(|it| count(it.windows(run, windows))).sum();
    let elsewhere = count(windows) - within;
    longest(stuck.into_iter()).filter(|_| 2 * elsewhere <= within)
}

/// Returns the longest interval in which a position is kept while the train goes on.
fn position(run: &Resolved) -> Option<Kept> {
    if run.position_source != PositionSource::Column {
        return None;
    }
    let position_m = &run.position_m;
    let steps =
        pairs(run.order.rows()).map(|(row, next)| (position_m[next] - position_m[row]).abs());
    let mut steps: Vec<f64> = steps.filter(|it| *it > 0.0).collect();
    let step_m = quantile(&mut steps, 0.5)?;
    let way_m = |it: &Kept| {
        let rows = it.rows.0..it.rows.1;
        let way = |row: usize| {
            let speed_mps = run.speeds.speed_mps[row];
            let is_known = !speed_mps.is_nan() && !run.speeds.is_spike[row];
            let step_s = run.times_s[row + 1] - run.times_s[row];
            if is_known { speed_mps * step_s.max(0.0) } else { 0.0 }
        };
        rows.map(way).sum::<f64>()
    };
    let all = kept(run, position_m).into_iter();
    longest(all.filter(|it| way_m(it) > KEPT_M.max(KEPT_STEPS * step_m)))
}

/// Returns the faults of a run's columns.
pub(super) fn column_faults(run: &Resolved) -> Vec<Diagnostic> {
    run.fill_values.iter().map(of_fill_value).chain(of_radius(run)).collect()
}

/// Returns that curves are narrower than any track, as where km are read as m.
fn of_radius(run: &Resolved) -> Option<Diagnostic> {
    let radii_m = run.table.column(Quantity::CurveRadius)?.iter().map(|radius_m| radius_m.abs());
    let narrow = radii_m.filter(|radius_m| *radius_m > 0.0 && *radius_m < RADIUS_MIN_M);
    let (count, least_m) = narrow
        .fold((0, f64::INFINITY), |(count, least_m), radius_m| (count + 1, radius_m.min(least_m)));
    let text = format!(
        "curve_radius lies below {RADIUS_MIN_M} m in {count} rows, down to {} m, where no track is: is the unit km?",
        shown(least_m)
    );
    let figures = [
        ("quantity", Quantity::CurveRadius.name().into()),
        ("count", Value::Integer(count)),
        ("least_m", least_m.into()),
    ];
    (count > 0).then(|| Diagnostic::new("narrow_curve", Warning, text, figures))
}

fn of_fill_value(fill: &FillValue) -> Diagnostic {
    let FillValue { quantity, column, value, count, others: (low, high) } = fill;
    let [value_shown, low, high] = [*value, *low, *high].map(shown);
    let text = format!(
        "column '{column}' holds {value_shown} in {count} rows, apart from its other values, {low} to {high}: taken for \
         missing values of {quantity}; leave such cells empty in the file"
    );
    let figures = [
        ("quantity", quantity.name().into()),
        ("value", (*value).into()),
        ("count", Value::Integer(*count as i64)),
    ];
    Diagnostic::new("fill_value", Warning, text, figures)
}

/// Returns a cell's number with up to three places.
fn shown(cell: f64) -> String {
    let text = format!("{cell:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use crate::Dataset;

    /// Returns the quantities of a train that are stuck: it speeds up and slows down by 0.6 m/s² by turns, by forces
    /// that show it, with columns replaced by time in s.
    fn stuck(replace: impl Fn(f64, [f64; 4]) -> [f64; 4]) -> Vec<String> {
        let train = "[train]\nmass_t=100\nlength_m=80\nrotating_mass_factor=0.05\n[resistance]\na=1\nb=0\n\
                     c=0\n[traction]\neffort=[[0,120],[30,100]]\n";
        let manifest = "[dataset]\nname='x'\n[train]\nfile='train.toml'\n[columns]\n\
                        time={column='t',unit='s'}\nspeed={column='v',unit='m/s'}\n\
                        traction_force={column='f',unit='N'}\nbrake_force={column='b',unit='N'}\n\
                        gradient={column='g',unit='permille'}\nposition={column='x',unit='m'}\n\
                        [[runs]]\nfile='1.csv'\n";
        let (mut speed_mps, mut position_m) = (2.0, 500.0);
        let row = |fifth: u32| {
            let time_s = 0.2 * f64::from(fifth);
            let phase_s = time_s % 80.0;
            let (traction_n, brake_n) = match phase_s {
                ..30.0 => (64e3, 0.0),
                ..40.0 => (0.0, 0.0),
                ..70.0 => (0.0, 62e3),
                _ => (0.0, 0.0),
            };
            let change_mps2 = (traction_n - brake_n - 1e3) / 105e3;
            position_m += 0.2 * speed_mps;
            speed_mps += 0.2 * change_mps2;
            let [v, f, b, x] = replace(time_s, [speed_mps, traction_n, brake_n, position_m]);
            format!("{time_s:.1},{v:.3},{f},{b},0,{x:.1}\n")
        };
        let csv = "t,v,f,b,g,x\n".to_owned() + &(0..=2000).map(row).collect::<String>();
        let files = [("dataset.toml", manifest), ("train.toml", train), ("1.csv", &csv)];
        let run = Dataset::load(&files[..]).unwrap().runs.remove(0);
        let found = run.diagnostics.iter().filter(|it| it.code == "stuck");
        found.map(|it| it.figures[0].1.as_str().unwrap_or_default().to_owned()).collect()
    }

    fn within(time_s: f64) -> bool {
        (100.0..250.0).contains(&time_s)
    }

    #[test]
    fn a_column_that_keeps_its_value_while_the_train_shows_another_is_named() {
        let none: [&str; 0] = [];
        assert_eq!(stuck(|_, row| row), none);
        let speed =
            |time_s, [v, f, b, x]: [f64; 4]| [if within(time_s) { 9.0 } else { v }, f, b, x];
        assert_eq!(stuck(speed), ["speed"]);
        for kept_n in [0.0, 64e3] {
            let traction =
                |time_s, [v, f, b, x]: [f64; 4]| [v, if within(time_s) { kept_n } else { f }, b, x];
            assert_eq!(stuck(traction), ["traction_force"], "{kept_n}");
        }
        for kept_n in [0.0, 62e3] {
            let brake =
                |time_s, [v, f, b, x]: [f64; 4]| [v, f, if within(time_s) { kept_n } else { b }, x];
            assert_eq!(stuck(brake), ["brake_force"], "{kept_n}");
        }
        let position =
            |time_s, [v, f, b, x]: [f64; 4]| [v, f, b, if within(time_s) { 900.0 } else { x }];
        assert_eq!(stuck(position), ["position"]);
    }
}
