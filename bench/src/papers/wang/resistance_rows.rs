//! Table 1 and 2: z1, z2 and z3 from one crossing of 28,000 samples.

use dynocar_core::pipeline::Estimator;
use dynocar_core::pipeline::mass::line_resistance::LineResistance;
use dynocar_core::pipeline::mass::printed_descent::SpeedUnit;
use dynocar_core::pipeline::mass::section::Section;
use dynocar_core::pipeline::mass::{
    DescentVariant, JointLeastSquares, JointLeastSquaresSettings, StagedDescent,
    StagedDescentSettings,
};
use dynocar_core::train::Davis;
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::PAPER;
use super::bound::Information;
use super::sensor::measure;
use super::shuttle::{Calm, Instant, Shuttle};
use crate::papers::row::Row;
use crate::papers::seeds::Seeds;
use crate::papers::statistics::{mean, root_mean_square};

/// Samples of one crossing.
pub const CROSSING: usize = 28_000;

const NAMES: [&str; 3] = ["basic resistance z1", "curve resistance z2", "tunnel resistance z3"];

/// Errors of one section over all seeds.
#[derive(Clone, Debug, Default)]
struct Errors {
    staged: Vec<f64>,
    ours: Vec<f64>,
    covered: Vec<f64>,
    nees: Vec<f64>,
}

/// The rows for resistance.
pub fn rows(seeds: Seeds) -> Vec<Row> {
    let shuttle = Shuttle::new(false);
    let ride = shuttle.crossing(CROSSING, &mut Calm);
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
    let empirical = differences(&empirical, &shuttle.truth.basic, &speeds[0]);
    rows[0].baseline = Some(root_mean_square(&empirical));
    rows.push(curve_in_tunnel_row(seeds.at_most(20)));
    rows.extend(printed_rows(&shuttle, &ride, seeds.at_most(20)));
    rows
}

/// With curves inside tunnels, which Algorithm 1 puts into the curve set.
fn curve_in_tunnel_row(seeds: Seeds) -> Row {
    let shuttle = Shuttle::new(true);
    let ride = shuttle.crossing(CROSSING, &mut Calm);
    let speeds = Section::ALL.map(|section| driven_speeds(&shuttle, &ride, section));
    let curve = Section::Curve as usize;
    let bound = Information::of(&shuttle, &ride).resistance_std(curve, &speeds[curve]);
    let errors = run(&shuttle, &ride, &speeds, seeds);
    let quantity = format!("{}: with two curves inside tunnels", NAMES[curve]);
    error_row(quantity, &errors[curve], Some(bound), seeds)
}

fn error_row(quantity: String, errors: &Errors, bound: Option<f64>, seeds: Seeds) -> Row {
    Row {
        paper: PAPER,
        table: "Table 2",
        quantity: format!(
            "{quantity}, error over the speeds driven there (paper's method: staged descent, \
             features normalised; baseline: Table 1's empirical values)"
        ),
        unit: "N/kN",
        published: None,
        paper_method: Some(root_mean_square(&errors.staged)),
        baseline: None,
        ours: Some(root_mean_square(&errors.ours)),
        bound,
        seeds: seeds.count,
        coverage: Some(mean(&errors.covered)),
        nees: Some(mean(&errors.nees)),
        nees_freedom: Some(3.0 * errors.nees.len() as f64),
    }
}

fn run(shuttle: &Shuttle, ride: &[Instant], speeds: &[Vec<f64>; 3], seeds: Seeds) -> [Errors; 3] {
    let truths = [shuttle.truth.basic, shuttle.truth.curve, shuttle.truth.tunnel];
    let mut errors: [Errors; 3] = Default::default();
    for seed in seeds.range() {
        let samples = measure(shuttle, ride, &mut ChaCha8Rng::seed_from_u64(seed));
        let mut staged = staged_descent(shuttle, DescentVariant::Normalised, SpeedUnit::default());
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
            errors[i].staged.extend(differences(&theirs[i], &truths[i], &speeds[i]));
            errors[i].add_ours(&ours[i], &truths[i], &covariance, &speeds[i]);
        }
    }
    errors
}

impl Errors {
    fn add_ours(
        &mut self,
        own: &Davis,
        truth: &Davis,
        covariance: &Matrix3<f64>,
        speeds_mps: &[f64],
    ) {
        let differences = differences(own, truth, speeds_mps);
        for (error, &speed) in differences.iter().zip(speeds_mps) {
            let powers = Vector3::new(1.0, speed, speed * speed);
            let std = powers.dot(&(covariance * powers)).sqrt();
            self.covered.push(f64::from(u8::from(error.abs() <= 1.96 * std)));
        }
        self.ours.extend(differences);
        let apart = Vector3::new(own.a - truth.a, own.b - truth.b, own.c - truth.c);
        let inverse = covariance.try_inverse().expect("positive definite");
        self.nees.push(apart.dot(&(inverse * apart)) / 3.0);
    }
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
        let mut in_kmh =
            staged_descent(shuttle, DescentVariant::Printed, SpeedUnit::KilometresPerHour);
        let mut in_mps =
            staged_descent(shuttle, DescentVariant::Printed, SpeedUnit::MetresPerSecond);
        let start = in_mps.resistance().basic.a;
        for sample in &samples {
            in_kmh.update(sample);
            in_mps.update(sample);
        }
        until.extend(in_kmh.diverged_after().map(|count| count as f64));
        moved.push((in_mps.resistance().basic.a - start).abs());
    }
    let row = |quantity: &str, unit, value| Row {
        paper: PAPER,
        table: "section 3.1",
        quantity: quantity.into(),
        unit,
        published: None,
        paper_method: Some(value),
        baseline: None,
        ours: None,
        bound: None,
        seeds: seeds.count,
        coverage: None,
        nees: None,
        nees_freedom: None,
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

fn staged_descent(shuttle: &Shuttle, variant: DescentVariant, unit: SpeedUnit) -> StagedDescent {
    let settings = StagedDescentSettings {
        variant,
        printed_speed_unit: unit,
        ..StagedDescentSettings::default()
    };
    StagedDescent::new(settings, &shuttle.train).expect("default settings")
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

fn differences(one: &Davis, other: &Davis, speeds_mps: &[f64]) -> Vec<f64> {
    speeds_mps.iter().map(|&speed| one.w0_n_per_kn(speed) - other.w0_n_per_kn(speed)).collect()
}
