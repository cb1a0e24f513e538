//! Faults of recorded forces that the motion, or the declared effort, contradicts.

use dynocar_core::plausibility::Severity::{Fundamental, Warning};
use dynocar_model::train::{EffortCurve, TrainModel};
use dynocar_shared::resistance::GRAVITY_MPS2;
use toml::Value;

use super::column_faults::{WINDOWS_MIN, Windows, moved_mps2};
use super::diagnostic::Diagnostic;
use super::forces::{Force, ForceSource};
use super::quantity::Quantity;
use super::resolved::{Context, Resolved};

/// Force in N below which a force counts as zero.
const ZERO_N: f64 = 1.0;
/// Change of speed in m/s² that no gradient of a railway makes.
const FORCED_MPS2: f64 = 0.5;
/// Time in s over which it is looked at, and the least time altogether.
const OVER_S: f64 = 3.0;
const FORCED_MIN_S: f64 = 5.0;
/// Force over the greatest declared effort above which no train exerts it.
const EFFORT_SHARE_MAX: f64 = 1.5;

/// Code of a traction force that is zero in all rows.
pub(super) const TRACTION_ALWAYS_ZERO: &str = "traction_always_zero";
/// Code of a brake force that is zero in all rows.
pub(super) const BRAKE_ALWAYS_ZERO: &str = "brake_always_zero";

/// Returns the faults of a run's recorded forces.
pub(super) fn force_faults(context: Context, run: &Resolved, windows: Windows) -> Vec<Diagnostic> {
    let (traction, brake) = (&run.forces.traction, &run.forces.brake);
    let zeros = [
        always_zero(run, (traction, windows), (Quantity::TractionForce, 1.0)),
        always_zero(run, (brake, windows), (Quantity::BrakeForce, -1.0)),
    ];
    let efforts = [
        beyond_effort(traction, Quantity::TractionForce, context.train, |it| it.traction.as_ref()),
        beyond_effort(brake, Quantity::BrakeForce, context.train, |it| it.brake.as_ref()),
    ];
    zeros.into_iter().chain(efforts).flatten().collect()
}

/// Returns that a force was not recorded: zero in all rows, while the speed changes as by force alone; `sign` is that of
/// the change.
fn always_zero(
    run: &Resolved,
    (force, windows): (&Force, Windows),
    (quantity, sign): (Quantity, f64),
) -> Option<Diagnostic> {
    let mut recorded = force.force_n.iter().filter(|it| !it.is_nan()).peekable();
    let is_recorded = force.source == ForceSource::Column && recorded.peek().is_some();
    if !is_recorded || recorded.any(|it| it.abs() >= ZERO_N) {
        return None;
    }
    let speeds = run.order.rows().map(|row| (run.times_s[row], run.speeds.speed_mps[row]));
    let (mut start, mut forced_s, mut greatest_mps2) = (None, 0.0, 0.0_f64);
    for (time_s, speed_mps) in speeds.filter(|it| !it.1.is_nan()) {
        let (from_s, from_mps) = *start.get_or_insert((time_s, speed_mps));
        let over_s = time_s - from_s;
        if over_s < OVER_S {
            continue;
        }
        start = Some((time_s, speed_mps));
        let change_mps2 = sign * (speed_mps - from_mps) / over_s;
        if change_mps2 > FORCED_MPS2 && over_s < 3.0 * OVER_S {
            forced_s += over_s;
            greatest_mps2 = greatest_mps2.max(change_mps2);
        }
    }
    let moved: Vec<f64> =
        windows.iter().filter_map(|it| moved_mps2(run, quantity, &it.1)).collect();
    let is_forced = forced_s >= FORCED_MIN_S || moved.len() >= WINDOWS_MIN;
    let greatest_mps2 = moved.into_iter().fold(greatest_mps2, f64::max);
    let by = match forced_s >= FORCED_MIN_S {
        true => format!("by more than {FORCED_MPS2} m/s²"),
        false => "more than gradient and resistance make it".into(),
    };
    let (code, changes, hint) = match quantity {
        Quantity::BrakeForce => (
            BRAKE_ALWAYS_ZERO,
            "slows down",
            "leave its column out, and explain with --traction-only",
        ),
        _ => (TRACTION_ALWAYS_ZERO, "speeds up", "map the column that holds it"),
    };
    let text = format!(
        "{quantity} is 0 in all rows, yet the train {changes} {by}: it was not \
         recorded; {hint}"
    );
    let figures = [("quantity", quantity.name().into()), ("greatest_mps2", greatest_mps2.into())];
    is_forced.then(|| Diagnostic::new(code, Fundamental, text, figures))
}

/// Returns that a force exceeds the declared effort by far in some rows, as where a recorder writes a number in the
/// place of a missing value; without a declared effort, that it exceeds the train's weight.
fn beyond_effort(
    force: &Force,
    quantity: Quantity,
    train: &TrainModel,
    effort: impl Fn(&TrainModel) -> Option<&EffortCurve>,
) -> Option<Diagnostic> {
    let declared_n = effort(train).map(EffortCurve::force_max_n).filter(|it| *it > 0.0);
    let (most_n, effort) = match declared_n {
        Some(most_n) => (most_n, format!("the declared effort of {most_n:.0} N")),
        None => {
            let weight_n = train.mass_kg * GRAVITY_MPS2;
            (weight_n / EFFORT_SHARE_MAX, format!("the train's weight of {weight_n:.0} N"))
        }
    };
    let rows = force.force_n.iter().zip(&force.is_spike).filter(|(_, is_spike)| !**is_spike);
    let is_beyond = |force_n: &f64| *force_n > EFFORT_SHARE_MAX * most_n;
    let beyond: Vec<f64> = rows.map(|row| *row.0).filter(is_beyond).collect();
    let greatest_n = beyond.iter().copied().reduce(f64::max)?;
    let count = beyond.len();
    let same = match beyond.iter().all(|it| *it == greatest_n) {
        true if count > 1 => format!("always {greatest_n:.0} N"),
        _ => format!("up to {greatest_n:.0} N"),
    };
    let text = format!(
        "{quantity} exceeds {effort} in {count} rows, {same}: is it a number in the place of a missing value, or \
         is the effort or the unit wrong?"
    );
    let figures = [
        ("quantity", quantity.name().into()),
        ("count", Value::Integer(count as i64)),
        ("greatest_n", greatest_n.into()),
        ("effort_n", most_n.into()),
    ];
    Some(Diagnostic::new("beyond_effort", Warning, text, figures))
}

#[cfg(test)]
mod tests {
    use crate::Dataset;

    /// Returns the codes of the diagnostics of a train that speeds up and slows down by 0.8 m/s² over 20 s each, with
    /// forces in N by the time in s.
    fn codes(traction_n: impl Fn(f64) -> f64, brake_n: impl Fn(f64) -> f64) -> Vec<&'static str> {
        codes_of(traction_n, brake_n, false)
    }

    fn codes_of(
        traction_n: impl Fn(f64) -> f64,
        brake_n: impl Fn(f64) -> f64,
        is_traction_only: bool,
    ) -> Vec<&'static str> {
        let train = "[train]\nmass_t=100\nlength_m=80\nrotating_mass_factor=0.05\n[resistance]\na=1\nb=0\n\
                     c=0\n[traction]\neffort=[[0,120],[30,100]]\n";
        let manifest = "[dataset]\nname='x'\n[train]\nfile='train.toml'\n[columns]\n\
                        time={column='t',unit='s'}\nspeed={column='v',unit='m/s'}\n\
                        traction_force={column='f',unit='N'}\nbrake_force={column='b',unit='N'}\n\
                        [[runs]]\nfile='1.csv'\n";
        let row = |tenth: u32| {
            let time_s = 0.1 * f64::from(tenth);
            let speed_mps = 1.0 + 0.8 * (20.0 - (time_s - 20.0).abs());
            format!("{time_s:.1},{speed_mps:.3},{},{}\n", traction_n(time_s), brake_n(time_s))
        };
        let csv = "t,v,f,b\n".to_owned() + &(0..=400).map(row).collect::<String>();
        let files = [("dataset.toml", manifest), ("train.toml", train), ("1.csv", &csv)];
        let mut dataset = Dataset::load(&files[..]).unwrap();
        if is_traction_only {
            dataset.keep_traction_only();
        }
        let of_forces = ["traction_always_zero", "brake_always_zero", "beyond_effort"];
        let found = dataset.runs[0].diagnostics.iter().map(|it| it.code);
        found.filter(|code| of_forces.contains(code)).collect()
    }

    fn pulls(time_s: f64) -> f64 {
        if time_s < 20.0 { 84e3 } else { 0.0 }
    }

    fn brakes(time_s: f64) -> f64 {
        if time_s < 20.0 { 0.0 } else { 84e3 }
    }

    #[test]
    fn a_force_that_is_always_zero_was_not_recorded_where_the_train_shows_one() {
        let none: [&str; 0] = [];
        assert_eq!(codes(pulls, brakes), none);
        assert_eq!(codes(pulls, |_| 0.0), ["brake_always_zero"]);
        assert_eq!(codes_of(pulls, |_| 0.0, true), none, "no braking is used");
        assert_eq!(codes(|_| 0.0, brakes), ["traction_always_zero"]);
        assert_eq!(codes(|_| f64::NAN, brakes), none, "cells without a number are another matter");
    }

    #[test]
    fn forces_far_beyond_the_declared_effort_are_counted() {
        let filled = |time_s: f64| if time_s % 5.0 < 0.95 { 655_350.0 } else { pulls(time_s) };
        assert_eq!(codes(filled, brakes), ["beyond_effort"]);
        let filled = |time_s: f64| if time_s % 5.0 < 0.95 { 9_999e3 } else { brakes(time_s) };
        assert_eq!(codes(pulls, filled), ["beyond_effort"], "the brake's effort is not declared");
    }
}
