//! The particle filter against an exact Kalman smoother.

use super::*;
use crate::filter::Gaussian;
use crate::filter::test_runs::MovingState;
use nalgebra::{Matrix2, Vector2};

const STEPS: usize = 8;

/// Position and speed with independent Gaussian noise, position measured.
struct Drifting {
    measured: [f64; STEPS],
}

const NOISE_STD: [f64; 2] = [0.3, 0.2];
const MEASURED_STD: f64 = 0.5;

fn drifting() -> Drifting {
    Drifting { measured: [0.2, 1.4, 1.9, 3.5, 3.6, 5.4, 5.8, 7.3] }
}

impl ParticleModel<2> for Drifting {
    fn draw_initial(&self, random: &mut Random) -> [f64; 2] {
        [random.normal(), 1.0 + 0.5 * random.normal()]
    }

    fn advance(&self, _step: usize) -> impl Fn([f64; 2]) -> [f64; 2] {
        |[position, speed]| [position + speed, speed]
    }

    fn draw_noise(&self, _step: usize) -> impl Fn(&mut Random) -> [f64; 2] {
        |random| NOISE_STD.map(|std| std * random.normal())
    }

    fn transition_densities(
        &self,
        _step: usize,
        advanced: [&[f64]; 2],
        successors: [&[f64]; 2],
        densities: &mut [f64],
    ) {
        let count = advanced[0].len();
        for (index, density) in densities.iter_mut().enumerate() {
            let (from, to) = (index / count, index % count);
            let square = |c: usize| {
                let off = (successors[c][to] - advanced[c][from]) / NOISE_STD[c];
                off * off
            };
            *density = (-0.5 * (square(0) + square(1))).exp();
        }
    }

    fn log_likelihood(&self, step: usize) -> impl Fn([f64; 2]) -> f64 {
        move |[position, _]| {
            let off = (self.measured[step] - position) / MEASURED_STD;
            -0.5 * off * off
        }
    }
}

/// Means and covariances given all measurements, by batch least squares.
fn exact() -> (Vec<Vector2<f64>>, Vec<Matrix2<f64>>) {
    let moving = MovingState {
        jacobian: Matrix2::new(1.0, 1.0, 0.0, 1.0),
        noise: Matrix2::from_diagonal(&Vector2::from(NOISE_STD.map(|std| std * std))),
        prior: Gaussian::independent(Vector2::new(0.0, 1.0), Vector2::new(1.0, 0.5)),
        measured: drifting().measured.to_vec(),
        variance: MEASURED_STD * MEASURED_STD,
    };
    moving.batch()
}

#[test]
fn many_particles_agree_with_the_exact_kalman_smoother() {
    let mut smoother = ParticleSmoother::new(1500, STEPS);
    let mut random = Random::new(11);
    smoother.filter(&drifting(), STEPS, &mut random).unwrap();
    smoother.smooth(&drifting()).unwrap();
    let (means, covariances) = exact();
    for (step, (exact_mean, exact_covariance)) in means.iter().zip(&covariances).enumerate() {
        let (mean, covariance) = smoother.smoothed_moments(step).unwrap();
        for i in 0..2 {
            let std = exact_covariance[(i, i)].sqrt();
            assert!((mean[i] - exact_mean[i]).abs() < 0.15 * std, "mean at {step}");
            let variance = exact_covariance[(i, i)];
            assert!((covariance[i][i] / variance - 1.0).abs() < 0.25, "variance at {step}");
        }
    }
}

#[test]
fn the_mean_deviation_is_the_sum_over_the_pair_weights_of_equation_27() {
    let mut smoother = ParticleSmoother::new(20, STEPS);
    smoother.filter(&drifting(), STEPS, &mut Random::new(2)).unwrap();
    smoother.smooth(&drifting()).unwrap();
    let n = smoother.particles;
    for step in 0..STEPS - 1 {
        smoother.fill_densities(&drifting(), step);
        let mut sum = [0.0; 2];
        for j in 0..n {
            let predicted: f64 = (0..n)
                .map(|l| smoother.filtered[step * n + l] * smoother.densities[l * n + j])
                .sum();
            for i in 0..n {
                let weight = smoother.filtered[step * n + i]
                    * smoother.smoothed[(step + 1) * n + j]
                    * smoother.densities[i * n + j]
                    / predicted;
                for (component, sum) in sum.iter_mut().enumerate() {
                    let after = smoother.states[component][(step + 1) * n + j];
                    *sum += weight * (after - smoother.advanced[component][step * n + i]);
                }
            }
        }
        let found = smoother.mean_deviation(step).unwrap();
        assert!((found[0] - sum[0]).abs() < 1e-12 && (found[1] - sum[1]).abs() < 1e-12);
    }
    assert_eq!(smoother.mean_deviation(STEPS - 1), None);
}

#[test]
fn equal_seeds_give_equal_bits() {
    let run = || {
        let mut smoother = ParticleSmoother::new(20, STEPS);
        smoother.filter(&drifting(), STEPS, &mut Random::new(4)).unwrap();
        smoother.smooth(&drifting()).unwrap();
        smoother.smoothed_moments(0).unwrap()
    };
    assert_eq!(run(), run());
}

#[test]
fn a_measurement_that_no_particle_explains_is_an_error_with_its_step() {
    let mut model = drifting();
    model.measured[3] = f64::NAN;
    let mut smoother = ParticleSmoother::new(20, STEPS);
    let failed = smoother.filter(&model, STEPS, &mut Random::new(4));
    assert_eq!(failed, Err(ParticleError::Degenerate { step: 3 }));
    assert_eq!(smoother.smoothed_moments(0), None, "a failed run leaves nothing behind");
}

/// Returns the ancestors by a search.
fn found(weights: &[f64], offset: f64) -> Vec<usize> {
    let spacing = weights.iter().sum::<f64>() / weights.len() as f64;
    let (mut ancestor, mut cumulated) = (0, weights[0]);
    (0..weights.len())
        .map(|index| {
            let level = (index as f64 + offset) * spacing;
            while ancestor + 1 < weights.len() && cumulated <= level {
                ancestor += 1;
                cumulated += weights[ancestor];
            }
            ancestor
        })
        .collect()
}

#[test]
fn the_ancestors_are_those_that_a_search_finds() {
    let mut random = Random::new(5);
    for round in 0..500 {
        let count = 1 + round % 33;
        // Some weights vanish, some are nearly all.
        let weights: Vec<f64> =
            (0..count).map(|_| (random.uniform() - 0.2).max(0.0).powi(5) + 1e-300).collect();
        let offset = random.uniform();
        let mut ancestors = vec![0; count + 1];
        find_ancestors(&weights, offset, &mut ancestors);
        assert_eq!(ancestors[..count], found(&weights, offset), "round {round}");
    }
}

#[test]
fn a_particle_of_all_the_weight_is_every_place_s_ancestor() {
    for heavy in 0..4 {
        let weights: Vec<f64> = (0..4).map(|i| f64::from(u8::from(i == heavy))).collect();
        let mut ancestors = [0; 5];
        find_ancestors(&weights, 0.5, &mut ancestors);
        assert_eq!(ancestors[..4], [heavy; 4]);
    }
}
