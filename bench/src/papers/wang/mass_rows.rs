//! Table 3: the mass on one leg.

use dynocar_core::force::ResolvedSample;
use dynocar_core::pipeline::mass::line_resistance::LineResistance;
use dynocar_core::pipeline::mass::{
    MassKalman, MassKalmanSettings, MassRegression, StagedDescent, StagedDescentSettings,
};
use dynocar_core::pipeline::{Estimator, Outcome};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::PAPER;
use super::bound::{Information, mass_std_in_wind};
use super::disturbance::{GradientError, Wind};
use super::line::{CURVE_RADIUS_M, STATIONS_M};
use super::sensor::measure;
use super::shuttle::{Calm, Disturbance, EMPTY_MASS_KG, Instant, PERIOD_S, Shuttle};
use crate::papers::row::Row;
use crate::papers::statistics::{mean, root_mean_square};

/// Mass in kg and published deviation in % of each line of Table 3.
const TABLE_3: [(f64, f64); 3] = [(110_000.0, 2.45), (117_100.0, 3.08), (114_000.0, 2.55)];

/// What acts on the leg beyond the model.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Condition {
    Calm,
    Wind,
    GradientError,
}

impl Condition {
    fn disturbance(self, shuttle: &Shuttle, seed: u64) -> Box<dyn Disturbance> {
        match self {
            Condition::Calm => Box::new(Calm),
            Condition::Wind => Box::new(Wind::new(shuttle.truth.basic.c, seed ^ 0x5eed)),
            Condition::GradientError => {
                Box::new(GradientError(if seed.is_multiple_of(2) { 1.0 } else { -1.0 }))
            }
        }
    }
}

/// Errors in % of the three ways over all seeds.
#[derive(Clone, Debug, Default)]
struct Errors {
    force_on_acceleration: Vec<f64>,
    acceleration_on_force: Vec<f64>,
    ours: Vec<f64>,
    covered: Vec<f64>,
    nees: Vec<f64>,
}

/// The rows for mass.
pub fn rows(seeds: usize) -> Vec<Row> {
    let shuttle = Shuttle::new(false);
    let mut rows = Vec::new();
    for (mass_kg, published) in TABLE_3 {
        let errors = run(&shuttle, mass_kg, Condition::Calm, 1.0, seeds);
        let leg = leg(&shuttle, mass_kg, &mut Calm);
        let bound = 100.0 * Information::of(&shuttle, &leg).mass_std();
        let quantity =
            format!("mass of {:.1} t after one leg of 3 km, newly loaded", 1e-3 * mass_kg);
        rows.push(error_row(quantity, Some(published), &errors, Some(bound), seeds));
    }
    let (mass_kg, published) = TABLE_3[1];
    let calm = run(&shuttle, mass_kg, Condition::Calm, 1.0, seeds);
    rows.push(Row {
        paper_method: Some(mean(&calm.force_on_acceleration)),
        baseline: Some(mean(&calm.acceleration_on_force)),
        ours: Some(mean(&calm.ours)),
        coverage: None,
        nees: None,
        ..error_row(
            "bias of the mass of 117.1 t: mean error with its sign".into(),
            Some(-published),
            &calm,
            None,
            seeds,
        )
    });
    rows.extend(disturbed_rows(&shuttle, mass_kg, seeds));
    rows.extend(misdeclared_rows(&shuttle, mass_kg, seeds));
    rows.push(step_row(&shuttle, seeds));
    rows
}

fn disturbed_rows(shuttle: &Shuttle, mass_kg: f64, seeds: usize) -> [Row; 2] {
    let calm_leg = leg(shuttle, mass_kg, &mut Calm);
    let wind = run(shuttle, mass_kg, Condition::Wind, 1.0, seeds);
    let gradient = run(shuttle, mass_kg, Condition::GradientError, 1.0, seeds);
    let wind_bound = 100.0 * mass_std_in_wind(shuttle, &calm_leg);
    let gradient_bound = 100.0 * Information::of(shuttle, &calm_leg).mass_std_with_bias();
    [
        error_row(
            "mass of 117.1 t after one leg, headwind of 3 m/s mean and 1 m/s gusts (standard deviations)".into(),
            None,
            &wind,
            Some(wind_bound),
            seeds,
        ),
        error_row(
            "mass of 117.1 t after one leg, gradient wrong by 1 permille".into(),
            None,
            &gradient,
            Some(gradient_bound),
            seeds,
        ),
    ]
}

/// What no estimator can tell from mass: the rows show the shift.
fn misdeclared_rows(shuttle: &Shuttle, mass_kg: f64, seeds: usize) -> [Row; 2] {
    let seeds = seeds.min(20);
    let rotating = Shuttle { inertia_factor: 1.08, ..shuttle.clone() };
    let cases = [
        (shuttle, 1.01, "the traction table 1 % too high"),
        (&rotating, 1.0, "a rotating mass of gamma = 0.08 ignored"),
    ];
    cases.map(|(shuttle, force_gain, text)| {
        let errors = run(shuttle, mass_kg, Condition::Calm, force_gain, seeds);
        Row {
            paper_method: Some(mean(&errors.force_on_acceleration)),
            baseline: Some(mean(&errors.acceleration_on_force)),
            ours: Some(mean(&errors.ours)),
            coverage: None,
            nees: None,
            ..error_row(
                format!("mean error of the mass of 117.1 t with {text}: not identifiable"),
                None,
                &errors,
                None,
                seeds,
            )
        }
    })
}

fn error_row(
    quantity: String,
    published: Option<f64>,
    errors: &Errors,
    bound: Option<f64>,
    seeds: usize,
) -> Row {
    Row {
        paper: PAPER,
        table: "Table 3",
        quantity: format!(
            "{quantity} (paper's method: force on differentiated speed; baseline: the reverse)"
        ),
        unit: "%",
        published,
        paper_method: Some(root_mean_square(&errors.force_on_acceleration)),
        baseline: Some(root_mean_square(&errors.acceleration_on_force)),
        ours: Some(root_mean_square(&errors.ours)),
        bound,
        seeds,
        coverage: Some(mean(&errors.covered)),
        nees: Some(mean(&errors.nees)),
    }
}

fn run(
    shuttle: &Shuttle,
    mass_kg: f64,
    condition: Condition,
    force_gain: f64,
    seeds: usize,
) -> Errors {
    let mut errors = Errors::default();
    for seed in 0..seeds as u64 {
        let mut disturbance = condition.disturbance(shuttle, seed);
        let ride = there_and_back(shuttle, mass_kg, &mut *disturbance);
        // Its own noise for every mass and condition.
        let stream = seed + ((mass_kg as u64) << 20) + ((condition as u64) << 50);
        let mut samples = measure(shuttle, &ride, &mut ChaCha8Rng::seed_from_u64(stream));
        for sample in &mut samples {
            sample.traction_force_n = sample.traction_force_n.map(|force| force * force_gain);
            sample.brake_force_n = sample.brake_force_n.map(|force| force * force_gain);
        }
        let percent = |estimate_kg: f64| 100.0 * (estimate_kg / mass_kg - 1.0);
        let mut kalman = kalman(shuttle);
        let mut forward = staged(shuttle, MassRegression::ForceOnAcceleration);
        let mut reverse = staged(shuttle, MassRegression::AccelerationOnForce);
        for sample in &samples {
            kalman.update(sample);
            forward.update(sample);
            reverse.update(sample);
        }
        let (estimate_kg, std_kg) = kalman.mass_kg();
        errors.ours.push(percent(estimate_kg));
        errors.force_on_acceleration.push(percent(forward.mass_kg()));
        errors.acceleration_on_force.push(percent(reverse.mass_kg()));
        let normalised = (estimate_kg - mass_kg) / std_kg;
        errors.covered.push(f64::from(u8::from(normalised.abs() <= 1.96)));
        errors.nees.push(normalised * normalised);
    }
    errors
}

/// A change of mass at a stop: seconds under force until the error stays below 1 %.
fn step_row(shuttle: &Shuttle, seeds: usize) -> Row {
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    let loaded_kg = 1.12 * EMPTY_MASS_KG;
    let ride = there_and_back(shuttle, loaded_kg, &mut Calm);
    let stop = ride.iter().position(|instant| instant.mass_kg == loaded_kg).expect("a second leg");
    for seed in 0..seeds as u64 {
        let samples = measure(shuttle, &ride, &mut ChaCha8Rng::seed_from_u64(seed));
        let (before, after) = samples.split_at(stop);
        let mut kalman = kalman(shuttle);
        let mut staged = staged(shuttle, MassRegression::AccelerationOnForce);
        for sample in before {
            kalman.update(sample);
            staged.update(sample);
        }
        ours.extend(settling_s(after, loaded_kg, &mut |sample| {
            (kalman.update(sample) == Outcome::Updated).then(|| kalman.mass_kg().0)
        }));
        theirs.extend(settling_s(after, loaded_kg, &mut |sample| {
            (staged.update(sample) == Outcome::Updated).then(|| staged.mass_kg())
        }));
    }
    Row {
        paper: PAPER,
        table: "Figure 9",
        quantity: "12 % more mass after a stop: time under force until the error stays below 1 % \
                   (baseline: differentiated speed on force)"
            .into(),
        unit: "s",
        published: None,
        paper_method: None,
        baseline: (theirs.len() == seeds).then(|| mean(&theirs)),
        ours: (ours.len() == seeds).then(|| mean(&ours)),
        bound: None,
        seeds,
        coverage: None,
        nees: None,
    }
}

/// Seconds of updates until the error stays below 1 %; `None` when it never does.
fn settling_s(
    samples: &[ResolvedSample],
    truth_kg: f64,
    estimate: &mut dyn FnMut(&ResolvedSample) -> Option<f64>,
) -> Option<f64> {
    let (mut under_force_s, mut settled_s) = (0.0, None);
    for sample in samples {
        let Some(mass_kg) = estimate(sample) else { continue };
        under_force_s += sample.step_s;
        if (mass_kg / truth_kg - 1.0).abs() >= 0.01 {
            settled_s = None;
        } else if settled_s.is_none() {
            settled_s = Some(under_force_s);
        }
    }
    settled_s
}

/// The leg of 3 km from the first station: power, coasting around 80 km/h, braking.
pub fn leg(shuttle: &Shuttle, mass_kg: f64, disturbance: &mut dyn Disturbance) -> Vec<Instant> {
    shuttle.drive(&shuttle.standing_at(STATIONS_M[0], mass_kg), STATIONS_M[1], 10.0, disturbance)
}

/// The empty train comes to the first station, a load changes it, and it runs the leg.
///
/// On the way there the filter learns the noise of the speed; the mass of the leg it has to
/// learn anew.
fn there_and_back(
    shuttle: &Shuttle,
    mass_kg: f64,
    disturbance: &mut dyn Disturbance,
) -> Vec<Instant> {
    let empty = shuttle.standing_at(STATIONS_M[1], EMPTY_MASS_KG);
    let mut ride = shuttle.drive(&empty, STATIONS_M[0], 20.0, disturbance);
    let last = ride[ride.len() - 1];
    let loaded = Instant { time_s: last.time_s + PERIOD_S, mass_kg, ..last };
    ride.extend(shuttle.drive(&loaded, STATIONS_M[1], 10.0, disturbance));
    ride
}

fn known_resistance(shuttle: &Shuttle) -> LineResistance {
    LineResistance {
        basic: shuttle.truth.basic,
        curve: Some(shuttle.truth.curve),
        tunnel: Some(shuttle.truth.tunnel),
        reference_radius_m: CURVE_RADIUS_M,
    }
}

/// Our filter with the resistances known.
pub fn kalman(shuttle: &Shuttle) -> MassKalman {
    let settings = MassKalmanSettings::default().with_resistance(&known_resistance(shuttle));
    MassKalman::new(settings, &shuttle.train).expect("default settings")
}

fn staged(shuttle: &Shuttle, mass_regression: MassRegression) -> StagedDescent {
    let settings = StagedDescentSettings { mass_regression, ..StagedDescentSettings::default() };
    let mut staged = StagedDescent::new(settings, &shuttle.train).expect("default settings");
    staged.resume(&known_resistance(shuttle));
    staged
}
