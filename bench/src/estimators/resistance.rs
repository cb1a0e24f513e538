//! The step of the resistance filter: two moving states and six constant ones.

use std::sync::Arc;

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::random::Random;
use dynocar_model::simulate::motion::{Motion, advance};
use dynocar_model::train::Davis;
use nalgebra::{RowSVector, SMatrix, SVector};

use super::measure::{Agreement, Case, Contender};
use super::textbook::TextbookFilter;

const SPEED: usize = 0;
const DISTURBANCE: usize = 1;
/// Davis a, b and c; then the scales of traction and brake and the delay of the forces.
const COEFFICIENTS: [usize; 3] = [2, 3, 4];
const STATES: usize = 8;

const SAMPLES: usize = 1000;
const STEP_S: f64 = 0.2;
const INERTIA: f64 = 108.0;
const SPEED_VARIANCE: f64 = 1e-3;
const IMPULSE_VARIANCE: f64 = 1e-7;
const DRIFT_VARIANCE: f64 = 1e-8;
/// Share of the disturbance that stays over a step, and the variance of what comes.
const KEPT: f64 = 0.99;
const RENEWED: f64 = 0.09 * (1.0 - KEPT * KEPT);

/// The derivatives of the speed after a step, and the speed measured then.
type Sample = (SVector<f64, STATES>, f64);

/// Traction, coasting and braking, linearised about the true speed.
fn samples() -> Arc<[Sample]> {
    let mut random = Random::new(31);
    let mut motion = Motion { distance_m: 0.0, speed_mps: 20.0 };
    let davis = Davis { a: 1.4, b: 0.02, c: 0.0011 };
    (0..SAMPLES)
        .map(|index| {
            let phase = (index / 80) % 3;
            let traction = if phase == 0 { 25.0 } else { 0.0 };
            let brake = if phase == 2 { 18.0 } else { 0.0 };
            let powers = [1.0, motion.speed_mps, motion.speed_mps * motion.speed_mps];
            let mut gradient = SVector::<f64, STATES>::zeros();
            gradient[SPEED] = 1.0;
            gradient[DISTURBANCE] = -STEP_S / INERTIA;
            for i in 0..3 {
                gradient[COEFFICIENTS[i]] = -STEP_S * powers[i] / INERTIA;
            }
            gradient[5] = STEP_S * traction / INERTIA;
            gradient[6] = -STEP_S * brake / INERTIA;
            gradient[7] = if index % 80 == 0 { 0.2 } else { 0.0 };
            let pull = |_: f64, now: Motion| {
                (traction - brake - davis.w0_n_per_kn(now.speed_mps)) / INERTIA
            };
            motion = advance(motion, STEP_S, pull);
            motion.speed_mps = motion.speed_mps.max(3.0);
            (gradient, motion.speed_mps + SPEED_VARIANCE.sqrt() * random.normal())
        })
        .collect()
}

fn first() -> (SVector<f64, STATES>, SMatrix<f64, STATES, STATES>) {
    let mean = SVector::<f64, STATES>::from([20.0, 0.0, 1.0, 0.02, 0.001, 1.0, 1.0, 0.0]);
    let std = SVector::<f64, STATES>::from([0.03, 0.3, 1.0, 0.05, 0.002, 0.05, 0.05, 0.5]);
    (mean, SMatrix::from_diagonal(&std.component_mul(&std)))
}

/// The cases of this module.
pub fn cases() -> Vec<Case> {
    let samples = samples();
    let ours = Contender::new("ours", SAMPLES, &samples, ours);
    let case = Case::new("resistance Kalman step, 8 states", Agreement::Relative(1e-6), ours);
    vec![case.peer(Contender::new("textbook EKF", SAMPLES, &samples, textbook))]
}

fn ours(samples: &[Sample]) -> Vec<f64> {
    let (mean, covariance) = first();
    let mut filter = Gaussian { mean, covariance };
    for (gradient, measured) in samples {
        let speed = gradient.dot(&filter.mean);
        filter.rewrite(SPEED, speed, gradient, IMPULSE_VARIANCE);
        let mut decay = SVector::<f64, STATES>::zeros();
        decay[DISTURBANCE] = KEPT;
        filter.rewrite(DISTURBANCE, KEPT * filter.mean[DISTURBANCE], &decay, RENEWED);
        for coefficient in COEFFICIENTS {
            filter.disturb(coefficient, DRIFT_VARIANCE);
        }
        filter.measure(SPEED, *measured, SPEED_VARIANCE).expect("a sound speed");
    }
    filter.mean.as_slice().to_vec()
}

fn textbook(samples: &[Sample]) -> Vec<f64> {
    let (mean, covariance) = first();
    let mut filter = TextbookFilter::new(mean, covariance);
    let mut row = RowSVector::<f64, STATES>::zeros();
    row[SPEED] = 1.0;
    let mut noise = SMatrix::<f64, STATES, STATES>::zeros();
    noise[(SPEED, SPEED)] = IMPULSE_VARIANCE;
    noise[(DISTURBANCE, DISTURBANCE)] = RENEWED;
    for coefficient in COEFFICIENTS {
        noise[(coefficient, coefficient)] = DRIFT_VARIANCE;
    }
    for (gradient, measured) in samples {
        let mut transition = SMatrix::<f64, STATES, STATES>::identity();
        transition.set_row(SPEED, &gradient.transpose());
        transition[(DISTURBANCE, DISTURBANCE)] = KEPT;
        filter.predict(transition * filter.mean, &transition, &noise);
        filter.measure(&row, *measured, SPEED_VARIANCE);
    }
    filter.mean.as_slice().to_vec()
}
