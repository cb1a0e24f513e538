//! Jin 2020: disc friction and braking ratio of a braking train.

use dynocar_core::pipeline::braking::intake::{BrakingCoefficient, DeclaredGear};
use dynocar_shared::{EffortPoint, Stop};

use super::braking::{JIN_TABLE_3, JIN_TABLE_4, PRESSURE_PA, declared, disc_friction, train};
use super::braking_score::{over_seeds, score, smoother};
use super::braking_table::{Table, drawn_rows, drawn_score};
use super::row::{PaperRow, Seeds};
use super::xie::{PAPER_GRAVITY_MPS2, stop_rows};
use crate::statistics::{KMH, mean};

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
pub fn rows(seeds: Seeds) -> Vec<PaperRow> {
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
