//! The step of the mass filter: eight behaviours of a bias side by side.

use std::sync::Arc;

use dynocar_core::filter::bank::{Bank, Nats};
use dynocar_core::filter::random::Random;
use dynocar_estimators::wang::MassKalmanSettings;
use dynocar_estimators::wang::bias_bank::{BIAS, BiasBank, Dynamics, INVERSE_MASS, MODELS, SPEED};
use dynocar_estimators::wang::bias_model::BiasModel;
use dynocar_estimators::wang::inertia::Inertia;
use dynocar_estimators::wang::line_resistance::LineResistance;
use dynocar_estimators::wang::motion::Motion;
use dynocar_model::simulate::motion as simulate;
use dynocar_model::train::TrainModel;
use nalgebra::{Matrix3, RowVector3, Vector3};

use super::measure::{Agreement, Case, Contender};
use super::textbook::TextbookFilter;

const SAMPLES: usize = 1000;
const STEP_S: f64 = 0.2;
const SPEED_VARIANCE: f64 = 4e-4;
const MEMORY: f64 = 3000.0;
/// A normalised innovation beyond which a speed counts less.
const HUBER: f64 = 3.0;
/// Standard deviation of the inverse mass over its reference.
const INVERSE_MASS_STD: f64 = 0.2;

struct Drive {
    dynamics: Dynamics,
    models: [BiasModel; MODELS],
    motions: Vec<Motion>,
}

/// Traction, coasting and braking of a train 5 % lighter than declared.
fn drive(train: &TrainModel) -> Arc<Drive> {
    let dynamics =
        Dynamics { resistance: LineResistance::declared(train), inertia: Inertia::of(train) };
    let mut random = Random::new(21);
    let mut train_motion = simulate::Motion { distance_m: 0.0, speed_mps: 12.0 };
    let motions = (0..SAMPLES).map(|index| {
        let force_n = match (index / 50) % 4 {
            0 | 1 => 0.15 * train.mass_kg,
            2 => 0.0,
            _ => -0.12 * train.mass_kg,
        };
        let mut motion = Motion {
            time_ns: (index as f64 * STEP_S * 1e9) as i64,
            segment: 0,
            speed_mps: train_motion.speed_mps + SPEED_VARIANCE.sqrt() * random.normal(),
            force_n,
            declared_kg: 1e5,
            known_n_per_kn: 2.0 * (0.01 * index as f64).sin(),
            gradient_std_permille: 0.0,
            curvature_per_m: 0.0,
            tunnel_share: 0.0,
        };
        let push_mps2 = 1.05 * dynamics.inertia.push_mps2(&motion);
        let pull =
            |_: f64, now: simulate::Motion| push_mps2 - dynamics.drag_mps2(&motion, now.speed_mps);
        train_motion = simulate::advance(train_motion, STEP_S, pull);
        motion.speed_mps = motion.speed_mps.max(1.0);
        motion
    });
    let motions = motions.collect();
    Arc::new(Drive { dynamics, models: MassKalmanSettings::default().bias_models(), motions })
}

/// The cases of this module, for a train.
pub fn cases(train: &TrainModel) -> Vec<Case> {
    let drive = drive(train);
    let ours = Contender::new("ours", SAMPLES - 1, &drive, ours);
    let case = Case::new("mass Kalman step, 8 behaviours", Agreement::Relative(1e-6), ours);
    vec![case.peer(Contender::new("textbook EKF bank", SAMPLES - 1, &drive, textbook))]
}

fn ours(drive: &Drive) -> Vec<f64> {
    let inverse_mass = (1.0, INVERSE_MASS_STD);
    let mut bank = BiasBank::new(drive.dynamics, drive.models, inverse_mass, MEMORY);
    bank.restart_speed(drive.motions[0].speed_mps, SPEED_VARIANCE);
    for pair in drive.motions.windows(2) {
        bank.predict(&pair[0], &pair[1], STEP_S);
        bank.measure(pair[1].speed_mps, SPEED_VARIANCE).expect("a sound speed");
    }
    let best = bank.best();
    vec![best.mean[SPEED], best.mean[INVERSE_MASS], best.covariance[(INVERSE_MASS, INVERSE_MASS)]]
}

fn textbook(drive: &Drive) -> Vec<f64> {
    let member = |model: &BiasModel| {
        let variances = Vector3::new(
            SPEED_VARIANCE,
            INVERSE_MASS_STD * INVERSE_MASS_STD,
            model.std_mps2 * model.std_mps2,
        );
        let mean = Vector3::new(drive.motions[0].speed_mps, 1.0, 0.0);
        (TextbookFilter::new(mean, Matrix3::from_diagonal(&variances)), *model)
    };
    let mut members = Bank::<_, Nats, MODELS>::even(drive.models.iter().map(member));
    let row = RowVector3::new(1.0, 0.0, 0.0);
    for pair in drive.motions.windows(2) {
        for ((filter, model), log_weight) in members.weighed_mut() {
            predict(filter, model, &drive.dynamics, pair);
            let variance = filter.covariance[(SPEED, SPEED)] + SPEED_VARIANCE;
            let size = (pair[1].speed_mps - filter.mean[SPEED]).abs() / variance.sqrt();
            let weight = (HUBER / size).min(1.0);
            filter.measure(&row, pair[1].speed_mps, SPEED_VARIANCE / weight);
            let surprise = 0.5 * size.min(HUBER).powi(2) + HUBER * (size - HUBER).max(0.0);
            *log_weight = (1.0 - 1.0 / MEMORY) * *log_weight - surprise - 0.5 * variance.ln();
        }
        members.settle();
        members.weighed_mut().for_each(|(_, log_weight)| *log_weight = log_weight.max(-30.0));
    }
    let (TextbookFilter { mean, covariance, .. }, _) = members.likeliest();
    vec![mean[SPEED], mean[INVERSE_MASS], covariance[(INVERSE_MASS, INVERSE_MASS)]]
}

/// Heun's rule with the force linear between the samples, linearised at the start.
fn predict(
    filter: &mut TextbookFilter<3>,
    model: &BiasModel,
    dynamics: &Dynamics,
    step: &[Motion],
) {
    let (from, to) = (&step[0], &step[1]);
    let (push_from, push_to) = (dynamics.inertia.push_mps2(from), dynamics.inertia.push_mps2(to));
    let (speed, inverse_mass, bias) =
        (filter.mean[SPEED], filter.mean[INVERSE_MASS], filter.mean[BIAS]);
    let shape = model.shape(speed);
    let start = push_from * inverse_mass - dynamics.drag_mps2(from, speed) + shape * bias;
    let ahead = speed + STEP_S * start;
    let end = push_to * inverse_mass - dynamics.drag_mps2(to, ahead) + shape * bias;
    let damping = dynamics.inertia.mps2_per_n_per_kn() * dynamics.resistance.slope(from, speed);
    let keep = model.keep(STEP_S);
    #[rustfmt::skip]
    let transition = Matrix3::new(
        1.0 - STEP_S * damping, 0.5 * STEP_S * (push_from + push_to), STEP_S * shape,
        0.0, 1.0, 0.0,
        0.0, 0.0, keep,
    );
    let mean = Vector3::new(speed + 0.5 * STEP_S * (start + end), inverse_mass, keep * bias);
    let bend = dynamics.inertia.mps2_per_n_per_kn() * (to.known_n_per_kn - from.known_n_per_kn);
    let change = (push_to - push_from) * inverse_mass - bend;
    let noise = Vector3::new(model.jump_variance(change, STEP_S), 0.0, model.noise_variance(keep));
    filter.predict(mean, &transition, &Matrix3::from_diagonal(&noise));
}
