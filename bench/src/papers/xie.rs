//! Xie 2019: wheel-rail adhesion of a braking train.

use dynocar_core::pipeline::braking::gear::DeclaredGear;
use dynocar_core::pipeline::braking::intake::BrakingCoefficient;
use dynocar_core::pipeline::braking::settings::LawSettings;
use dynocar_estimators::xie::{EStep, EmSettings};
use dynocar_model::train::TrainModel;
use dynocar_shared::{EffortPoint, RailAdhesion, RailCondition, Stop, Uncertain};

use super::braking::{PRESSURE_PA, STEP_S, XIE_TABLE_2, XIE_TABLE_3, train};
use super::braking_score::{MIDDLE_STEPS, em, over_seeds, score};
use super::braking_table::{Table, drawn_rows};
use super::literal_em::finite_changes;
use super::row::Row;
use super::seeds::Seeds;
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
pub fn rows(seeds: Seeds) -> Vec<Row> {
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

/// What the printed cap and the printed density make of the EM.
fn printed_forms(table: &Table, seeds: Seeds) -> Vec<Row> {
    let capped = |initial, what| {
        let [score] = score(&table.braking, seeds, [MIDDLE_STEPS], |seed| {
            let (e_step, has_printed_cap) = (EStep::Kalman, true);
            let given = EmSettings { initial, seed, e_step, has_printed_cap, ..Default::default() };
            em(BrakingCoefficient::Adhesion, given)
        });
        Row { paper_method: Some(score.relative_percent), ..table.row(what, "%", seeds) }
    };
    let widths = over_seeds(seeds, |seed| {
        let moments = table.braking.simulate(seed);
        finite_changes(&moments, table.initial(seed), seed).map(|(low, high)| 0.5 * (high - low))
    });
    let widths: Vec<f64> = widths.into_iter().flatten().collect();
    let frozen = over_seeds(seeds, |seed| {
        // With the printed density the gradient is zero: the initial value is the estimate.
        let moments = table.braking.simulate(seed);
        let scored = moments.iter().filter(|moment| moment.is_scored);
        mean(
            &scored
                .map(|moment| 100.0 * (table.initial(seed) / moment.truth - 1.0).abs())
                .collect::<Vec<_>>(),
        )
    });
    vec![
        capped(Some(0.05), "mean relative error, printed cap min(F, B), from 0.05"),
        capped(Some(0.12), "mean relative error, printed cap min(F, B), from 0.12"),
        Row {
            paper_method: Some(mean(&widths)),
            ..table.row(
                "change that leaves Q finite, printed uniform density",
                "1",
                Seeds::from_zero(widths.len()),
            )
        },
        Row {
            paper_method: Some(mean(&frozen)),
            ..table.row("mean relative error, printed uniform density", "%", seeds)
        },
    ]
}

/// One stop: speeds in km/h, what the rail carries, and the paper's metres and seconds.
struct PublishedStop {
    from_kmh: f64,
    to_kmh: f64,
    what: &'static str,
    adhesion: RailAdhesion,
    distance_m: f64,
    time_s: f64,
}

const STOPS: [PublishedStop; 6] = {
    const fn stop(
        (from_kmh, to_kmh): (f64, f64),
        what: &'static str,
        adhesion: RailAdhesion,
        (distance_m, time_s): (f64, f64),
    ) -> PublishedStop {
        PublishedStop { from_kmh, to_kmh, what, adhesion, distance_m, time_s }
    }
    const HIGH: RailAdhesion = RailAdhesion::Coefficient(Uncertain::exact(0.1542));
    const LOW: RailAdhesion = RailAdhesion::Coefficient(Uncertain::exact(0.0726));
    const WET: RailAdhesion = RailAdhesion::Law(RailCondition::Wet, Uncertain::exact(1.0));
    [
        stop((300.0, 100.0), "adhesion 0.1542", HIGH, (3060.7, 56.1)),
        stop((300.0, 100.0), "adhesion 0.0726", LOW, (3946.7, 71.7)),
        stop((300.0, 100.0), "wet rail", WET, (3481.1, 62.8)),
        stop((250.0, 50.0), "adhesion 0.1542", HIGH, (2404.3, 59.3)),
        stop((250.0, 50.0), "adhesion 0.0726", LOW, (2958.9, 72.7)),
        stop((250.0, 50.0), "wet rail", WET, (2614.4, 62.7)),
    ]
};

/// Gravity of the papers in m/s².
pub const PAPER_GRAVITY_MPS2: f64 = 9.8;

/// Stopping distances and times: the paper's recursion in steps of 0.2 s and ours.
fn stops() -> Vec<Row> {
    let train = train();
    let gear = DeclaredGear::of(&train.brake_gear).expect("a declared gear");
    let force_n = gear.declared_force_n(PRESSURE_PA);
    let effort = [EffortPoint { speed_mps: 0.0, force_n }];
    let davis = [train.resistance.a, train.resistance.b, train.resistance.c];
    let mut rows = Vec::new();
    for published in &STOPS {
        let stop = Stop {
            to_speed_mps: published.to_kmh * KMH,
            adhesion: published.adhesion,
            gravity_mps2: PAPER_GRAVITY_MPS2,
            ..Stop::level(published.from_kmh * KMH, train.mass_kg, davis, &effort)
        };
        let ours = stop.estimate(0.95).expect("a stop");
        let carried = |speed_mps| match published.adhesion {
            RailAdhesion::Coefficient(coefficient) => coefficient.value,
            RailAdhesion::Law(condition, scale) => scale.value * condition.adhesion(speed_mps),
            RailAdhesion::Unlimited => f64::INFINITY,
        };
        let weight_n = train.mass_kg * PAPER_GRAVITY_MPS2;
        let (distance_m, time_s) =
            stop_in_steps(&train, &stop, |speed_mps| force_n.min(weight_n * carried(speed_mps)));
        let speeds =
            format!("{} to {} km/h, {}", published.from_kmh, published.to_kmh, published.what);
        rows.extend(stop_rows(
            "Xie 2019",
            if published.from_kmh > 275.0 { "figures 10, 11" } else { "figures 20, 21" },
            &speeds,
            (published.distance_m, published.time_s),
            (distance_m, time_s),
            (ours.distance_m, ours.time_s),
        ));
    }
    rows
}

/// The papers' recursion, Xie 2019, eq. (2)-(3) with the position corrected: metres and seconds.
pub fn stop_in_steps(
    train: &TrainModel,
    stop: &Stop<'_>,
    brake_n: impl Fn(f64) -> f64,
) -> (f64, f64) {
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
            return (distance_m, time_s);
        }
        speed_mps = after_mps;
    }
}

/// A row of metres and one of seconds.
pub fn stop_rows(
    paper: &'static str,
    table: &'static str,
    what: &str,
    published: (f64, f64),
    in_steps: (f64, f64),
    ours: (f64, f64),
) -> Vec<Row> {
    let row = |quantity: String, unit, published, in_steps, ours| Row {
        published: Some(published),
        paper_method: Some(in_steps),
        ours: Some(ours),
        ..Row::new(paper, table, quantity, unit, Seeds::from_zero(1))
    };
    vec![
        row(format!("braking distance, {what}"), "m", published.0, in_steps.0, ours.0),
        row(format!("braking time, {what}"), "s", published.1, in_steps.1, ours.1),
    ]
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
