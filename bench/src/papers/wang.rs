//! Wang 2022: staged learning of resistance and mass, traction energy.
//!
//! - [`shuttle`], [`ride`]: the scenario, from line to samples
//! - [`bound`]: the Cramér–Rao bounds
//! - [`resistance_rows`], [`mass_rows`]: the comparison
//!
//! The effect of the learned mass on the traction energy of a leg is that of figure 10. The empty train of 110 t runs
//! from the second station to the first. Its controller plans a speed for each place and computes the force from an
//! assumed mass: 117.1 t, as if the testers of Table 3 were always on board, or the mass that the filter has learned on
//! the previous leg.

mod bound;
mod mass_rows;
mod resistance_rows;
mod ride;
mod shuttle;

use dynocar_model::simulate::motion::deceleration_mps2;
use dynocar_tests::chance::Chance;

use self::ride::{kalman, known_resistance, leg, measure};
use self::shuttle::{
    BRAKE_MAX_N, EMPTY_MASS_KG, PERIOD_S, STATIONS_M, Shuttle, ShuttleMoment, calm,
};
use super::row::{PaperRow, Seeds, WANG};
use crate::statistics::{mean, straight_line};

/// Returns every row of the paper over a number of seeded runs.
///
/// A row whose runs are whole crossings, or whose results hardly scatter, has 20 runs at most; each row states its
/// number.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = resistance_rows::rows(seeds);
    rows.extend(mass_rows::rows(seeds));
    rows.extend(energy_rows(seeds));
    rows
}

/// The fixed mass in kg that the controller assumes without learning.
const ASSUMED_MASS_KG: f64 = 117_100.0;
/// The saving in % of the paper's abstract.
const PUBLISHED_SAVING: f64 = 6.13;
/// Cruising speed in m/s of the plan.
const CRUISE_MPS: f64 = 70.0 / 3.6;
const ACCELERATION_MPS2: f64 = 0.7;
const BRAKING_MPS2: f64 = 0.7;
/// Gain of the closed-loop control in 1/s: the feed-forward control has none.
const CLOSED_LOOP_PER_S: f64 = 0.5;

/// A train and the gain and assumed mass of its controller.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Case {
    /// Gain of the correction by the error of the speed, added to the force that the assumed mass needs for the planned
    /// acceleration at this place.
    gain_per_s: f64,
    mass_kg: f64,
    assumed_kg: f64,
}

/// Energy and time of a driven leg.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Driven {
    energy_j: f64,
    time_s: f64,
}

/// Returns the rows for energy.
fn energy_rows(seeds: Seeds) -> Vec<PaperRow> {
    let shuttle = Shuttle::new(false);
    let seeds = seeds.at_most(20);
    let learned_kg: Vec<f64> =
        (seeds.range()).map(|seed| learned_mass_kg(&shuttle, seed)).collect();
    let mut rows = Vec::new();
    for (gain_per_s, name) in [(CLOSED_LOOP_PER_S, "closed-loop"), (0.0, "feed-forward")] {
        let fixed = Case { gain_per_s, mass_kg: EMPTY_MASS_KG, assumed_kg: ASSUMED_MASS_KG };
        let others = learned_kg.iter().map(|&assumed_kg| Case { assumed_kg, ..fixed });
        let text = format!("{name} control, 110 t: the learned mass instead of 117.1 t");
        rows.extend(comparison(&shuttle, &text, &fixed, others));
    }
    let (gain_per_s, mass_kg) = (CLOSED_LOOP_PER_S, ASSUMED_MASS_KG);
    let heavy = Case { gain_per_s, mass_kg, assumed_kg: mass_kg };
    let light = Case { mass_kg: EMPTY_MASS_KG, assumed_kg: EMPTY_MASS_KG, ..heavy };
    let text = "two trains: 110 t instead of 117.1 t, each controlled with its own mass";
    rows.extend(comparison(&shuttle, text, &heavy, [light].into_iter()));
    rows
}

/// Returns the energy saved against a case, and how much later the train arrives.
fn comparison(
    shuttle: &Shuttle,
    text: &str,
    fixed: &Case,
    others: impl Iterator<Item = Case>,
) -> [PaperRow; 2] {
    let (mut as_it_comes, mut at_equal_time, mut later_s) = (Vec::new(), Vec::new(), Vec::new());
    let before = drive(shuttle, fixed, CRUISE_MPS);
    let equal_before = energy_at_time(shuttle, fixed, before.time_s);
    for other in others {
        let after = drive(shuttle, &other, CRUISE_MPS);
        as_it_comes.push(100.0 * (1.0 - after.energy_j / before.energy_j));
        let equal_after = energy_at_time(shuttle, &other, before.time_s);
        at_equal_time.push(100.0 * (1.0 - equal_after / equal_before));
        later_s.push(after.time_s - before.time_s);
    }
    let row = |quantity: String, unit, paper_method: &[f64]| PaperRow {
        paper_method: Some(mean(paper_method)),
        ..PaperRow::new(WANG, "Figure 10", quantity, unit, Seeds::from_zero(at_equal_time.len()))
    };
    let saving = format!("traction energy saved, {text}");
    let later = format!("later arrival, {text}, whatever the running times");
    [
        PaperRow {
            published: Some(PUBLISHED_SAVING),
            ours: Some(mean(&at_equal_time)),
            ..row(saving, "%", &as_it_comes)
                .noted("paper's method: whatever the running times; ours: at equal running time")
        },
        row(later, "s", &later_s),
    ]
}

/// Returns the energy in J of a case at a running time, from a straight line through the logarithms of
/// energy and time at 41 cruising speeds; single runs scatter with the sample at which the
/// brake is applied.
fn energy_at_time(shuttle: &Shuttle, case: &Case, time_s: f64) -> f64 {
    let points: Vec<(f64, f64)> = (-20..=20)
        .map(|k| drive(shuttle, case, CRUISE_MPS * (1.0 + 0.002 * f64::from(k))))
        .map(|driven| ((driven.time_s / time_s).ln(), driven.energy_j.ln()))
        .collect();
    straight_line(&points).0.exp()
}

/// Returns the mass that the filter knows after the leg before.
fn learned_mass_kg(shuttle: &Shuttle, seed: u64) -> f64 {
    let ride = leg(shuttle, EMPTY_MASS_KG, &mut calm);
    let mut kalman = kalman(shuttle, &known_resistance(shuttle));
    for sample in measure(shuttle, &ride, &mut Chance::new(seed)) {
        kalman.update(&sample);
    }
    kalman.filter.mass_kg().0
}

fn drive(shuttle: &Shuttle, case: &Case, cruise_mps: f64) -> Driven {
    let start = shuttle.standing_at(STATIONS_M[1], case.mass_kg);
    let mut follower = plan_follower(*case, cruise_mps);
    let ride = shuttle.drive_with(&mut follower, &start, STATIONS_M[0], 1.0, &mut calm);
    // The train stops between two samples.
    let moving = ride.iter().rposition(|instant| instant.speed_mps > 0.0).expect("it has moved");
    let [before, last] = [ride[moving - 1], ride[moving]];
    let braking_mps2 = (before.speed_mps - last.speed_mps) / PERIOD_S;
    let time_s = last.time_s + last.speed_mps / braking_mps2.max(0.1);
    Driven { energy_j: traction_energy_j(&ride), time_s }
}

/// E = ∫ F_t v dt of Wang 2022, eq. (28)-(29), where the paper calls the force F_t a power; force
/// and speed are linear between two instants, and braking gives nothing back.
fn traction_energy_j(ride: &[ShuttleMoment]) -> f64 {
    let work_j = |pair: &[ShuttleMoment]| {
        let [from_n, to_n] = [pair[0].force_n.max(0.0), pair[1].force_n.max(0.0)];
        let [from_mps, to_mps] = [pair[0].speed_mps, pair[1].speed_mps];
        let product = 2.0 * (from_n * from_mps + to_n * to_mps) + from_n * to_mps + to_n * from_mps;
        (pair[1].time_s - pair[0].time_s) * product / 6.0
    };
    ride.windows(2).map(work_j).sum()
}

/// Returns a controller that follows the plan from station to station.
fn plan_follower(case: Case, cruise_mps: f64) -> impl FnMut(&Shuttle, &ShuttleMoment, f64) -> f64 {
    let mut is_stopping = false;
    move |shuttle, now, to_m| {
        let left_m = (to_m - now.position_m).abs();
        // Wherever the plan has led, the train has to stop at the platform; no mass is assumed.
        let stop_mps2 = deceleration_mps2((now.speed_mps, 0.0), left_m.max(1.0));
        is_stopping |= stop_mps2 > BRAKING_MPS2;
        if is_stopping {
            return -now.mass_kg * stop_mps2.clamp(0.5, 1.0);
        }
        let travelled_m = (now.position_m - STATIONS_M[1]).abs();
        let rising_mps = (2.0 * ACCELERATION_MPS2 * travelled_m).sqrt();
        let (speed_mps, acceleration_mps2) = if rising_mps < cruise_mps {
            (rising_mps, ACCELERATION_MPS2)
        } else {
            (cruise_mps, 0.0)
        };
        let planned = ShuttleMoment { speed_mps, mass_kg: case.assumed_kg, force_n: 0.0, ..*now };
        // The force at which the assumed train would just move as planned.
        let drag_mps2 = -shuttle.acceleration_mps2(&planned, 0.0);
        let correction_mps2 = case.gain_per_s * (speed_mps - now.speed_mps);
        let wanted_n = case.assumed_kg * (acceleration_mps2 + drag_mps2 + correction_mps2);
        let most_n =
            shuttle.train.traction.as_ref().map_or(0.0, |curve| curve.force_n(now.speed_mps));
        wanted_n.clamp(-BRAKE_MAX_N, most_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row<'a>(rows: &'a [PaperRow], beginning: &str) -> &'a PaperRow {
        rows.iter().find(|row| row.quantity.starts_with(beginning)).expect(beginning)
    }

    #[test]
    fn every_figure_of_a_short_run_is_a_number_and_ours_beat_the_papers() {
        let rows = rows(Seeds::from_zero(6));
        for row in &rows {
            let figures =
                [row.paper_method, row.baseline, row.ours, row.bound, row.coverage, row.nees];
            assert!(figures.iter().flatten().all(|figure| figure.is_finite()), "{row:?}");
        }
        for beginning in
            ["basic resistance", "curve resistance", "tunnel resistance", "mass of 117.1 t after"]
        {
            let row = row(&rows, beginning);
            let (paper, ours) = (row.paper_method.unwrap(), row.ours.unwrap());
            let bound = row.bound.unwrap();
            assert!(ours < 0.5 * paper, "{row:?}");
            // Six runs scatter: the root mean square of six lies within a factor of two.
            assert!(ours < 2.0 * bound && ours > 0.4 * bound, "{row:?}");
        }
        let disturbed = [
            ("mass of 117.1 t after one leg, headwind", 0.6),
            ("mass of 117.1 t after one leg, gradient", 0.6),
        ];
        for (beginning, limit_percent) in disturbed {
            assert!(row(&rows, beginning).ours.unwrap() < limit_percent);
        }
        let bias = row(&rows, "bias of the mass");
        assert!(bias.paper_method.unwrap() < -2.0 && bias.ours.unwrap().abs() < 0.05, "{bias:?}");
        let settling = row(&rows, "12 % more mass");
        assert!(settling.ours.unwrap() < 30.0 && settling.paper_method.is_none(), "{settling:?}");
    }

    #[test]
    fn what_is_not_identifiable_shifts_the_mass_by_as_much() {
        let rows = mass_rows::rows(Seeds::from_zero(2));
        let gain = row(&rows, "mean error of the mass of 117.1 t with the traction table");
        assert!((gain.ours.unwrap() - 1.0).abs() < 0.1, "{gain:?}");
        let rotating = row(&rows, "mean error of the mass of 117.1 t with a rotating mass");
        assert!((rotating.ours.unwrap() - 8.0).abs() < 0.5, "{rotating:?}");
    }

    #[test]
    fn at_equal_running_time_the_assumed_mass_hardly_changes_the_energy() {
        let rows = energy_rows(Seeds::from_zero(1));
        for control in ["closed-loop", "feed-forward"] {
            let saving = row(&rows, &format!("traction energy saved, {control}"));
            assert!(saving.ours.unwrap().abs() < 1.0, "{saving:?}");
        }
        let feed_forward = row(&rows, "traction energy saved, feed-forward");
        assert!(feed_forward.paper_method.unwrap() > 2.0, "{feed_forward:?}");
        assert!(row(&rows, "later arrival, feed-forward").paper_method.unwrap() > 1.0);
        let two_trains = row(&rows, "traction energy saved, two trains");
        assert!((two_trains.ours.unwrap() - 6.06).abs() < 0.5, "{two_trains:?}");
    }

    #[test]
    fn a_force_and_a_speed_that_both_change_are_integrated_exactly_and_brakes_give_nothing_back() {
        let at = |time_s: f64, speed_mps: f64, force_n: f64| ShuttleMoment {
            time_s,
            position_m: 0.0,
            speed_mps,
            force_n,
            direction: 1.0,
            mass_kg: 1e5,
        };
        // F = 1000 t, v = t over 2 s: ∫ 1000 t² dt = 8000/3.
        let mut ride: Vec<ShuttleMoment> =
            (0..=10).map(|k| 0.2 * f64::from(k)).map(|t| at(t, t, 1000.0 * t)).collect();
        assert!((traction_energy_j(&ride) - 8000.0 / 3.0).abs() < 1e-6);
        ride.extend([at(2.0, 2.0, -5000.0), at(3.0, 1.0, -5000.0)]);
        assert!((traction_energy_j(&ride) - 8000.0 / 3.0).abs() < 1e-6);
    }
}
