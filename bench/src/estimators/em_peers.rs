//! Expectation maximisation over a window as the formulas stand (Xie 2019, section 2).

use dynocar_core::filter::random::Random;
use dynocar_core::pipeline::braking::engine::Observation;
use dynocar_core::pipeline::braking::law::Law;
use dynocar_core::pipeline::braking::motion::{self, MotionNoise, Move, StepInputs};
use nalgebra::{Matrix2, RowVector2, Vector2};

use super::textbook::{TextbookFilter, TextbookStep, smooth};

/// Noise of motion and measurement (Xie 2019), as variances.
pub const NOISE: MotionNoise = MotionNoise {
    distance_m2_per_s: 0.0167,
    speed_m2_per_s3: 0.00129,
    measured_distance_m2: 0.01,
    measured_speed_m2_per_s2: None,
};
/// Particles of the papers' E-step.
pub const PARTICLES: usize = 20;
/// Iterations of EM in a window.
pub const ITERATIONS: usize = 50;
/// Where EM starts.
pub const INITIAL: f64 = 0.07;
/// Standard deviation in m/s of a window's first speed.
pub const FIRST_SPEED_STD_MPS: f64 = 0.1;
/// The step of every sample.
pub const INPUTS: StepInputs = StepInputs {
    step_s: 0.2,
    gain_mps2: 9.81,
    demand: 0.0942,
    tied_mps2: 0.0,
    basic_mps2: [0.0077, 2.3e-4, 1.46e-5],
};

/// Variances of distance and speed over a step.
fn step_variances() -> [f64; 2] {
    [NOISE.distance_m2_per_s * INPUTS.step_s, NOISE.speed_m2_per_s3 * INPUTS.step_s]
}

fn moved(state: [f64; 2], coefficient: f64) -> ([f64; 2], Move) {
    let step = motion::advance(&INPUTS, &Law::Constant, state[1], coefficient);
    ([state[0] + step.travelled_m, step.speed_mps], step)
}

/// Gradient and curvature of Q by the coefficient.
#[derive(Default)]
struct Score {
    gradient: f64,
    curvature: f64,
}

impl Score {
    fn add(&mut self, weight: f64, from: [f64; 2], to: [f64; 2], coefficient: f64) {
        let (expected, step) = moved(from, coefficient);
        let slopes = [0.5 * INPUTS.step_s * step.speed_by_scale, step.speed_by_scale];
        for (i, variance) in step_variances().into_iter().enumerate() {
            self.gradient += weight * slopes[i] * (to[i] - expected[i]) / variance;
            self.curvature += weight * slopes[i] * slopes[i] / variance;
        }
    }
}

/// EM with a Kalman filter and the Rauch-Tung-Striebel smoother for an E-step.
pub fn textbook_kalman_em(window: &[Observation]) -> f64 {
    let mut coefficient = INITIAL;
    for _ in 0..ITERATIONS {
        let forward = forward(window, coefficient);
        let smoothed = smooth(&forward).expect("covariances have inverses");
        let mut score = Score::default();
        for pair in smoothed.windows(2) {
            score.add(1.0, pair[0].mean.into(), pair[1].mean.into(), coefficient);
        }
        coefficient += score.gradient / score.curvature;
    }
    coefficient
}

fn forward(window: &[Observation], coefficient: f64) -> Vec<TextbookStep<2>> {
    let first_variances =
        Vector2::new(NOISE.measured_distance_m2, FIRST_SPEED_STD_MPS * FIRST_SPEED_STD_MPS);
    let mean = Vector2::new(window[0].distance_m, window[0].speed_mps);
    let mut filter = TextbookFilter::new(mean, Matrix2::from_diagonal(&first_variances));
    let added = Matrix2::from_diagonal(&Vector2::from(step_variances()));
    let row = RowVector2::new(1.0, 0.0);
    let step = |(index, observed): (usize, &Observation)| {
        let moved = (index > 0).then(|| {
            let (mean, step) = moved(filter.mean.into(), coefficient);
            let by_speed = step.speed_by_speed;
            let by_distance = 0.5 * INPUTS.step_s * (1.0 + by_speed);
            (mean.into(), Matrix2::new(1.0, by_distance, 0.0, by_speed))
        });
        filter.pass(moved, &added, &row, observed.distance_m, NOISE.measured_distance_m2)
    };
    window.iter().enumerate().map(step).collect()
}

/// Particles of one step: states and filtered weights.
struct Cloud {
    states: Vec<[f64; 2]>,
    weights: Vec<f64>,
}

/// EM with a particle filter and marginal smoother for an E-step; every pair of particles is
/// summed over in both, as eq. 24-33 say.
pub fn textbook_particle_em(window: &[Observation], random: &mut Random) -> f64 {
    let mut coefficient = INITIAL;
    for _ in 0..ITERATIONS {
        let clouds = filter(window, coefficient, random);
        let score = smoothed_score(&clouds, coefficient);
        coefficient += score.gradient / score.curvature;
    }
    coefficient
}

fn filter(window: &[Observation], coefficient: f64, random: &mut Random) -> Vec<Cloud> {
    let [distance_std, speed_std] = step_variances().map(f64::sqrt);
    let mut clouds: Vec<Cloud> = Vec::with_capacity(window.len());
    for observed in window {
        let states: Vec<[f64; 2]> = match clouds.last() {
            None => (0..PARTICLES)
                .map(|_| {
                    let distance_m =
                        observed.distance_m + NOISE.measured_distance_m2.sqrt() * random.normal();
                    [distance_m, observed.speed_mps + FIRST_SPEED_STD_MPS * random.normal()]
                })
                .collect(),
            Some(before) => resampled(before, random)
                .into_iter()
                .map(|state| {
                    let ([distance_m, speed_mps], _) = moved(state, coefficient);
                    [
                        distance_m + distance_std * random.normal(),
                        speed_mps + speed_std * random.normal(),
                    ]
                })
                .collect(),
        };
        let likelihood = |state: &[f64; 2]| {
            let apart = observed.distance_m - state[0];
            (-0.5 * apart * apart / NOISE.measured_distance_m2).exp()
        };
        let mut weights: Vec<f64> = states.iter().map(likelihood).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        clouds.push(Cloud { states, weights });
    }
    clouds
}

/// Systematic resampling.
fn resampled(cloud: &Cloud, random: &mut Random) -> Vec<[f64; 2]> {
    let mut level = random.uniform() / PARTICLES as f64;
    let (mut sum, mut index) = (cloud.weights[0], 0);
    (0..PARTICLES)
        .map(|_| {
            while sum <= level && index + 1 < PARTICLES {
                index += 1;
                sum += cloud.weights[index];
            }
            level += 1.0 / PARTICLES as f64;
            cloud.states[index]
        })
        .collect()
}

fn smoothed_score(clouds: &[Cloud], coefficient: f64) -> Score {
    let variances = step_variances();
    let mut score = Score::default();
    let mut later = clouds.last().map_or(Vec::new(), |cloud| cloud.weights.clone());
    for pair in clouds.windows(2).rev() {
        let (here, next) = (&pair[0], &pair[1]);
        let density = |from: &[f64; 2], to: &[f64; 2]| {
            let (expected, _) = moved(*from, coefficient);
            let exponent: f64 = (0..2).map(|i| (to[i] - expected[i]).powi(2) / variances[i]).sum();
            (-0.5 * exponent).exp()
        };
        let densities: Vec<Vec<f64>> = here
            .states
            .iter()
            .map(|from| next.states.iter().map(|to| density(from, to)).collect())
            .collect();
        let predicted: Vec<f64> = (0..PARTICLES)
            .map(|j| (0..PARTICLES).map(|i| here.weights[i] * densities[i][j]).sum())
            .collect();
        let mut smoothed = vec![0.0; PARTICLES];
        for i in 0..PARTICLES {
            for j in 0..PARTICLES {
                let both = here.weights[i] * densities[i][j] * later[j] / predicted[j];
                smoothed[i] += both;
                score.add(both, here.states[i], next.states[j], coefficient);
            }
        }
        later = smoothed;
    }
    score
}
