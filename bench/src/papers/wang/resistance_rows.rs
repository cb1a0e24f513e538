//! Table 1 and 2: z1, z2 and z3 from one crossing of 28,000 samples.

use dynocar_core::pipeline::Estimator;
use dynocar_estimators::wang::line_resistance::LineResistance;
use dynocar_estimators::wang::section::Section;
use dynocar_estimators::wang::{JointLeastSquares, JointLeastSquaresSettings};
use dynocar_estimators::wang::{StagedDescent, StagedDescentSettings};
use dynocar_model::train::Davis;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::bound::Information;
use super::printed::PrintedDescent;
use super::sensor::measure;
use super::shuttle::{Instant, Shuttle, calm};
use crate::papers::row::{Row, WANG};
use crate::papers::score::{Score, w0_errors};
use crate::papers::seeds::Seeds;
use crate::statistics::{mean, root_mean_square};

/// Samples of one crossing.
pub const CROSSING: usize = 28_000;

const NAMES: [&str; 3] = ["basic resistance z1", "curve resistance z2", "tunnel resistance z3"];

/// Errors of one section over all seeds.
#[derive(Clone, Debug, Default)]
struct Errors {
    staged: Vec<f64>,
    ours: Score,
}

/// The rows for resistance.
pub fn rows(seeds: Seeds) -> Vec<Row> {
    let shuttle = Shuttle::new(false);
    let ride = shuttle.crossing(CROSSING, &mut calm);
    let speeds = Section::ALL.map(|section| driven_speeds(&shuttle, &ride, section));
    let information = Information::of(&shuttle, &ride);
    let errors = run(&shuttle, &ride, &speeds, seeds);
    let mut rows: Vec<Row> = Section::ALL
        .iter()
        .map(|&section| {
            let i = section as usize;
            let quantity = format!("{}: one crossing of 28,000 samples", NAMES[i]);
            let bound = information.resistance_std(i, &speeds[i]);
            error_row(quantity, &errors[i], Some(bound), seeds)
        })
        .collect();
    let empirical = Davis { a: 2.7551, b: 0.014 * 3.6, c: 0.00075 * 12.96 };
    let empirical = w0_errors(&empirical, &shuttle.truth.basic, &speeds[0]);
    rows[0].baseline = Some(root_mean_square(&empirical));
    rows.push(curve_in_tunnel_row(seeds.at_most(20)));
    rows.extend(printed_rows(&shuttle, &ride, seeds.at_most(20)));
    rows
}

/// With curves inside tunnels, which Algorithm 1 puts into the curve set.
fn curve_in_tunnel_row(seeds: Seeds) -> Row {
    let shuttle = Shuttle::new(true);
    let ride = shuttle.crossing(CROSSING, &mut calm);
    let speeds = Section::ALL.map(|section| driven_speeds(&shuttle, &ride, section));
    let curve = Section::Curve as usize;
    let bound = Information::of(&shuttle, &ride).resistance_std(curve, &speeds[curve]);
    let errors = run(&shuttle, &ride, &speeds, seeds);
    let quantity = format!("{}: with two curves inside tunnels", NAMES[curve]);
    error_row(quantity, &errors[curve], Some(bound), seeds)
}

fn error_row(quantity: String, errors: &Errors, bound: Option<f64>, seeds: Seeds) -> Row {
    let quantity = format!(
        "{quantity}, error over the speeds driven there (paper's method: staged descent, \
         features normalised; baseline: Table 1's empirical values)"
    );
    Row {
        paper_method: Some(root_mean_square(&errors.staged)),
        bound,
        ..errors.ours.row(Row::new(WANG, "Table 2", quantity, "N/kN", seeds))
    }
}

fn run(shuttle: &Shuttle, ride: &[Instant], speeds: &[Vec<f64>; 3], seeds: Seeds) -> [Errors; 3] {
    let truths = [shuttle.truth.basic, shuttle.truth.curve, shuttle.truth.tunnel];
    let mut errors: [Errors; 3] = Default::default();
    for seed in seeds.range() {
        let samples = measure(shuttle, ride, &mut ChaCha8Rng::seed_from_u64(seed));
        let mut staged = staged_descent(shuttle);
        let mut joint = joint_least_squares(shuttle);
        for sample in &samples {
            staged.update(sample);
            joint.update(sample);
        }
        let ours = polynomials(&joint.resistance().expect("a sound regression"));
        let theirs = polynomials(&staged.resistance());
        for section in Section::ALL {
            let i = section as usize;
            let covariance = joint.resistance_covariance(section).expect("a sound regression");
            errors[i].staged.extend(w0_errors(&theirs[i], &truths[i], &speeds[i]));
            errors[i].ours.take_resistance((&ours[i], &covariance), &truths[i], &speeds[i]);
        }
    }
    errors
}

/// Our estimator with its default settings: the mass is not known to it.
pub fn joint_least_squares(shuttle: &Shuttle) -> JointLeastSquares {
    let settings = JointLeastSquaresSettings::default();
    JointLeastSquares::new(settings, &shuttle.train).expect("default settings")
}

/// The rows that show the printed learning rate to fail.
fn printed_rows(shuttle: &Shuttle, ride: &[Instant], seeds: Seeds) -> [Row; 2] {
    let (mut until, mut moved) = (Vec::new(), Vec::new());
    for seed in seeds.range() {
        let samples = measure(shuttle, ride, &mut ChaCha8Rng::seed_from_u64(seed));
        let mut in_kmh = PrintedDescent::new(3.6, &shuttle.train);
        let mut in_mps = PrintedDescent::new(1.0, &shuttle.train);
        let start = in_mps.first_coefficient();
        for sample in &samples {
            in_kmh.update(sample);
            in_mps.update(sample);
        }
        until.extend(in_kmh.diverged_after().map(|count| count as f64));
        moved.push((in_mps.first_coefficient() - start).abs());
    }
    let row = |quantity: &str, unit, value| Row {
        paper_method: Some(value),
        ..Row::new(WANG, "section 3.1", quantity, unit, seeds)
    };
    [
        row("learning rate 1e-7, speed in km/h: samples until it has diverged", "1", mean(&until)),
        row(
            "learning rate 1e-7, speed in m/s: change of alpha_1 in 28,000 samples",
            "N/kN",
            mean(&moved),
        ),
    ]
}

fn staged_descent(shuttle: &Shuttle) -> StagedDescent {
    StagedDescent::new(StagedDescentSettings::default(), &shuttle.train).expect("default settings")
}

fn polynomials(resistance: &LineResistance) -> [Davis; 3] {
    [Some(resistance.basic), resistance.curve, resistance.tunnel]
        .map(|davis| davis.expect("all three are learned"))
}

/// Twenty speeds in m/s over the middle 90 % of those driven in a section.
fn driven_speeds(shuttle: &Shuttle, ride: &[Instant], section: Section) -> Vec<f64> {
    let mut speeds: Vec<f64> = ride
        .iter()
        .filter(|instant| instant.speed_mps > 1.0)
        .filter(|instant| {
            let shares = shuttle.shares(instant.position_m);
            match section {
                Section::Basic => shares.curve == 0.0 && shares.tunnel == 0.0,
                Section::Curve => shares.curve > 0.999,
                Section::Tunnel => shares.tunnel > 0.999,
            }
        })
        .map(|instant| instant.speed_mps)
        .collect();
    speeds.sort_by(f64::total_cmp);
    let at = |share: f64| speeds[(share * (speeds.len() - 1) as f64) as usize];
    let (low, high) = (at(0.05), at(0.95));
    (0..20).map(|k| low + (high - low) * f64::from(k) / 19.0).collect()
}
