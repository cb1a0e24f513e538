//! Xie 2019: wheel-rail adhesion of a braking train.

use dynocar_core::pipeline::braking::intake::{BrakingCoefficient, DeclaredGear};
use dynocar_core::pipeline::braking::settings::LawSettings;
use dynocar_estimators::xie::{EStep, EmSettings};
use dynocar_model::train::TrainModel;
use dynocar_shared::{EffortPoint, RailAdhesion, RailCondition, Stop, Uncertain};

use super::braking::{PRESSURE_PA, STEP_S, XIE_TABLE_2, XIE_TABLE_3, train};
use super::braking_score::{MIDDLE_STEPS, em, over_seeds, score};
use super::braking_table::{Table, drawn_rows};
use super::row::{PaperRow, Seeds};
use crate::statistics::{KMH, mean};

/// Initial values of both tables.
const INITIALS: &[f64] = &[0.0, 0.03, 0.05, 0.09, 0.12];

const TABLES: [Table; 2] = [
    Table {
        paper: "Xie 2019",
        table: "2",
        name: "adhesion",
        braking: XIE_TABLE_2,
        initials: INITIALS,
        published_percent: 1.8705,
        published_baseline_percent: 12.0350,
    },
    Table {
        paper: "Xie 2019",
        table: "3",
        name: "adhesion",
        braking: XIE_TABLE_3,
        initials: INITIALS,
        published_percent: 1.8169,
        published_baseline_percent: 13.1255,
    },
];

/// Tables 2 and 3, the printed forms that fail, and the stopping distances.
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = Vec::new();
    for table in &TABLES {
        rows.extend(table.comparison(seeds));
        rows.extend(table.known_law(LawSettings::default().scale_std, seeds));
    }
    rows.extend(printed_forms(&TABLES[0], seeds));
    rows.extend(drawn_rows("Xie 2019", BrakingCoefficient::Adhesion, "adhesion", seeds));
    rows.extend(stops());
    rows
}

/// Returns the rows of the EM with the printed cap and the printed density.
fn printed_forms(table: &Table, seeds: Seeds) -> Vec<PaperRow> {
    let capped = |initial, what| {
        let [score] = score(&table.braking, seeds, [MIDDLE_STEPS], |seed| {
            let (e_step, has_printed_cap) = (EStep::Kalman, true);
            let given = EmSettings { initial, seed, e_step, has_printed_cap, ..Default::default() };
            em(BrakingCoefficient::Adhesion, given)
        });
        PaperRow { paper_method: Some(score.relative_percent), ..table.row(what, "%", seeds) }
    };
    let frozen = over_seeds(seeds, |seed| {
        // With the printed density the gradient is zero: the initial value is the estimate.
        let moments = table.braking.simulate(seed);
        let scored = moments.iter().filter(|moment| moment.is_scored);
        mean(scored.map(|moment| 100.0 * (table.initial(seed) / moment.truth - 1.0).abs()))
    });
    vec![
        capped(Some(0.05), "mean relative error, printed cap min(F, B), from 0.05"),
        capped(Some(0.12), "mean relative error, printed cap min(F, B), from 0.12"),
        PaperRow {
            paper_method: Some(mean(&frozen)),
            ..table.row("mean relative error, printed uniform density", "%", seeds)
        },
    ]
}

/// A stop of the paper: first and last speed in km/h, the adhesion of the rail in words and numbers, and the published
/// metres and seconds.
struct PublishedStop {
    speeds_kmh: [f64; 2],
    rail: &'static str,
    adhesion: RailAdhesion,
    published: [f64; 2],
}

const STOPS: [PublishedStop; 6] = {
    const fn stop(
        speeds_kmh: [f64; 2],
        rail: &'static str,
        adhesion: RailAdhesion,
        published: [f64; 2],
    ) -> PublishedStop {
        PublishedStop { speeds_kmh, rail, adhesion, published }
    }
    const HIGH: RailAdhesion = RailAdhesion::Coefficient(Uncertain::exact(0.1542));
    const LOW: RailAdhesion = RailAdhesion::Coefficient(Uncertain::exact(0.0726));
    const WET: RailAdhesion = RailAdhesion::Law(RailCondition::Wet, Uncertain::exact(1.0));
    [
        stop([300.0, 100.0], "adhesion 0.1542", HIGH, [3060.7, 56.1]),
        stop([300.0, 100.0], "adhesion 0.0726", LOW, [3946.7, 71.7]),
        stop([300.0, 100.0], "wet rail", WET, [3481.1, 62.8]),
        stop([250.0, 50.0], "adhesion 0.1542", HIGH, [2404.3, 59.3]),
        stop([250.0, 50.0], "adhesion 0.0726", LOW, [2958.9, 72.7]),
        stop([250.0, 50.0], "wet rail", WET, [2614.4, 62.7]),
    ]
};

/// Gravity of the papers in m/s².
pub const PAPER_GRAVITY_MPS2: f64 = 9.8;

/// Stopping distances and times: the paper's recursion in steps of 0.2 s and ours.
fn stops() -> Vec<PaperRow> {
    let train = train();
    let gear = DeclaredGear::from_gear(&train.brake_gear).expect("a declared gear");
    let force_n = gear.declared_force_n(PRESSURE_PA);
    let effort = [EffortPoint { speed_mps: 0.0, force_n }];
    let davis = [train.resistance.a, train.resistance.b, train.resistance.c];
    let weight_n = train.mass_kg * PAPER_GRAVITY_MPS2;
    let of = |&PublishedStop { speeds_kmh, rail, adhesion, published }: &PublishedStop| {
        let [from_kmh, to_kmh] = speeds_kmh;
        let stop = Stop {
            to_speed_mps: to_kmh * KMH,
            adhesion,
            gravity_mps2: PAPER_GRAVITY_MPS2,
            ..Stop::level(from_kmh * KMH, train.mass_kg, davis, &effort)
        };
        let carried = |speed_mps| match adhesion {
            RailAdhesion::Coefficient(coefficient) => coefficient.value,
            RailAdhesion::Law(condition, scale) => scale.value * condition.adhesion(speed_mps),
            RailAdhesion::Unlimited => f64::INFINITY,
        };
        let brake_n = |speed_mps| force_n.min(weight_n * carried(speed_mps));
        let table = if from_kmh > 275.0 { "figures 10, 11" } else { "figures 20, 21" };
        let what = format!("{from_kmh} to {to_kmh} km/h, {rail}");
        stop_rows(["Xie 2019", table], &what, published, (&train, &stop), brake_n)
    };
    STOPS.iter().flat_map(of).collect()
}

/// Rows of metres and of seconds: as published, by the papers' recursion, by ours.
pub fn stop_rows(
    [paper, table]: [&'static str; 2],
    what: &str,
    published: [f64; 2],
    (train, stop): (&TrainModel, &Stop<'_>),
    brake_n: impl Fn(f64) -> f64,
) -> [PaperRow; 2] {
    let ours = stop.estimate(0.95).expect("a stop");
    let (ours, in_steps) = ([ours.distance_m, ours.time_s], stop_in_steps(train, stop, brake_n));
    let quantities = [("distance", "m"), ("time", "s")];
    std::array::from_fn(|which| {
        let (name, unit) = quantities[which];
        let quantity = format!("braking {name}, {what}");
        PaperRow {
            published: Some(published[which]),
            paper_method: Some(in_steps[which]),
            ours: Some(ours[which]),
            ..PaperRow::new(paper, table, quantity, unit, Seeds::from_zero(1))
        }
    })
}

/// Returns the papers' recursion, Xie 2019, eq. (2)-(3) with the position corrected: metres and seconds.
fn stop_in_steps(train: &TrainModel, stop: &Stop<'_>, brake_n: impl Fn(f64) -> f64) -> [f64; 2] {
    let weight_kn = 1e-3 * train.mass_kg * stop.gravity_mps2;
    let (mut distance_m, mut time_s, mut speed_mps) = (0.0, 0.0, stop.from_speed_mps);
    loop {
        let resistance_n = weight_kn * train.resistance.w0_n_per_kn(speed_mps);
        let lost_mps = STEP_S * (brake_n(speed_mps) + resistance_n) / train.mass_kg;
        // The last step ends where the speed does.
        let share = ((speed_mps - stop.to_speed_mps) / lost_mps).min(1.0);
        let after_mps = speed_mps - share * lost_mps;
        distance_m += 0.5 * share * STEP_S * (speed_mps + after_mps);
        time_s += share * STEP_S;
        if share < 1.0 {
            return [distance_m, time_s];
        }
        speed_mps = after_mps;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_of_the_paper_and_the_integral_over_speed_agree() {
        for pair in stops().chunks(2) {
            for row in pair {
                let (steps, ours) = (row.paper_method.unwrap(), row.ours.unwrap());
                assert!((steps / ours - 1.0).abs() < 1e-3, "{row:?}");
                assert!((ours / row.published.unwrap() - 1.0).abs() < 0.04, "{row:?}");
            }
        }
    }

    #[test]
    fn drawn_adhesion_is_found_at_the_bound_with_honest_intervals() {
        for row in
            drawn_rows("Xie 2019", BrakingCoefficient::Adhesion, "adhesion", Seeds::from_zero(60))
        {
            let ratio = row.ours.unwrap() / row.bound.unwrap();
            assert!((0.9..1.1).contains(&ratio), "{row:?}");
            assert!((0.92..0.98).contains(&row.coverage.unwrap()), "{row:?}");
        }
    }

    #[test]
    fn on_the_papers_curve_the_smoother_beats_filter_and_particles() {
        let rows = TABLES[0].comparison(Seeds::from_zero(12));
        for row in &rows[..2] {
            let ours = row.ours.unwrap();
            assert!(ours < row.baseline.unwrap() && ours < row.paper_method.unwrap(), "{row:?}");
        }
        assert!(rows[2].ours.unwrap() < rows[2].paper_method.unwrap(), "{:?}", rows[2]);
    }

    #[test]
    fn the_printed_cap_sticks_where_the_start_exceeds_the_demand() {
        let rows = printed_forms(&TABLES[0], Seeds::from_zero(4));
        assert!(rows[0].paper_method.unwrap() < 5.0, "{:?}", rows[0]);
        assert!(rows[1].paper_method.unwrap() > 30.0, "{:?}", rows[1]);
    }
}
