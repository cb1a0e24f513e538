//! The papers on brakings: Xie 2019, wheel-rail adhesion; Jin 2020, disc friction and braking ratio.

use dynocar_core::pipeline::braking::intake::{BrakingCoefficient, DeclaredGear};
use dynocar_core::pipeline::braking::settings::LawSettings;
use dynocar_estimators::xie::{EStep, EmSettings};
use dynocar_model::train::TrainModel;
use dynocar_shared::{EffortPoint, RailAdhesion, RailCondition, Stop, Uncertain};

use super::braking::{
    JIN_TABLE_3, JIN_TABLE_4, PRESSURE_PA, STEP_S, XIE_TABLE_2, XIE_TABLE_3, declared,
    disc_friction, train,
};
use super::braking_score::{MIDDLE_STEPS, em, over_seeds, score, smoother};
use super::braking_table::{Table, drawn_rows, drawn_score};
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
pub fn xie(seeds: Seeds) -> Vec<PaperRow> {
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

const FRICTION: Table = Table {
    paper: "Jin 2020",
    table: "3",
    name: "disc friction",
    braking: JIN_TABLE_3,
    initials: &[0.15, 0.20, 0.25, 0.30, 0.35, 0.40],
    published_percent: 2.4807,
    published_baseline_percent: 4.9278,
};

const RATIO: Table = Table {
    paper: "Jin 2020",
    table: "4",
    name: "braking ratio",
    braking: JIN_TABLE_4,
    initials: &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
    published_percent: 1.3154,
    published_baseline_percent: 1.7799,
};

/// Standard deviation of the scale of a known friction curve beforehand, as in the estimator.
const SCALE_STD: f64 = 1.0;

/// Tables 3 and 4, and the stop of figure 8.
pub fn jin(seeds: Seeds) -> Vec<PaperRow> {
    let mut rows = FRICTION.comparison(seeds);
    rows.extend(FRICTION.known_law(SCALE_STD, seeds));
    rows.extend(RATIO.comparison(seeds));
    rows.extend(ratio_extras(seeds));
    rows.extend(drawn_rows("Jin 2020", BrakingCoefficient::Friction, "disc friction", seeds));
    rows.extend(drawn_rows("Jin 2020", BrakingCoefficient::Ratio, "braking ratio", seeds));
    rows.extend(stop());
    rows
}

/// Returns a ratio that hardly moves gains from a window of 40 s, and the declared value is hard to beat.
fn ratio_extras(seeds: Seeds) -> Vec<PaperRow> {
    // 10 s back, the random walk of 0.4 % after 1 s remembers about as long on either side.
    let [back] = score(&RATIO.braking, seeds, [50], |_| smoother(BrakingCoefficient::Ratio, 10.0));
    let drawn = drawn_score(BrakingCoefficient::Ratio, 10.0, 50, seeds);
    let nominal = over_seeds(seeds, |seed| {
        let moments = RATIO.braking.simulate(seed);
        let scored = moments.iter().filter(|moment| moment.is_scored);
        let declared = declared(BrakingCoefficient::Ratio);
        mean(scored.map(|moment| 100.0 * (declared / moment.truth - 1.0).abs()))
    });
    let row = RATIO
        .row("mean relative error, 10 s back", "%", seeds)
        .noted("baseline: always the declared 2.55");
    vec![PaperRow {
        published: Some(RATIO.published_percent),
        baseline: Some(mean(&nominal)),
        ours: Some(back.relative_percent),
        ..back.row(back.nees_freedom_of_one_curve(&drawn), row)
    }]
}

/// Returns the stop from 350 km/h of figure 8.
fn stop() -> [PaperRow; 2] {
    let train = train();
    let gear = DeclaredGear::from_gear(&train.brake_gear).expect("a declared gear");
    let force_n = |speed_mps: f64| gear.force_n(PRESSURE_PA, disc_friction(speed_mps), gear.ratio);
    let effort: Vec<EffortPoint> = (0..=350)
        .map(|kmh| {
            let speed_mps = f64::from(kmh) * KMH;
            EffortPoint { speed_mps, force_n: force_n(speed_mps) }
        })
        .collect();
    let davis = [train.resistance.a, train.resistance.b, train.resistance.c];
    let stop = Stop {
        gravity_mps2: PAPER_GRAVITY_MPS2,
        ..Stop::level(350.0 * KMH, train.mass_kg, davis, &effort)
    };
    let source = ["Jin 2020", "figure 8"];
    stop_rows(source, "350 km/h to standstill", [4647.16, 94.2], (&train, &stop), force_n)
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

    #[test]
    fn the_stop_of_figure_8_is_reproduced() {
        for row in stop() {
            let (published, ours) = (row.published.unwrap(), row.ours.unwrap());
            assert!((ours / published - 1.0).abs() < 1e-4, "{row:?}");
            assert!((row.paper_method.unwrap() / ours - 1.0).abs() < 1e-3, "{row:?}");
        }
    }

    #[test]
    fn drawn_friction_and_ratio_are_found_at_the_bound_with_honest_intervals() {
        let rows = |sought| drawn_rows("Jin 2020", sought, "drawn", Seeds::from_zero(60));
        for row in
            rows(BrakingCoefficient::Friction).into_iter().chain(rows(BrakingCoefficient::Ratio))
        {
            let ratio = row.ours.unwrap() / row.bound.unwrap();
            // 60 runs are worth some 200 independent errors: three times 5 %.
            assert!((0.85..1.15).contains(&ratio), "{row:?}");
            assert!((0.92..0.98).contains(&row.coverage.unwrap()), "{row:?}");
        }
    }

    #[test]
    fn a_known_curve_is_worth_more_than_a_lag() {
        let lagged = FRICTION.comparison(Seeds::from_zero(6))[2].ours.unwrap();
        let known = FRICTION.known_law(SCALE_STD, Seeds::from_zero(6))[0].ours.unwrap();
        assert!(known < 0.6 * lagged, "{known} against {lagged}");
    }
}
