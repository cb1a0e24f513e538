//! The E-step: what the states of a window look like under a value of the coefficient.

use std::f64::consts::LOG2_E;

use dynocar_core::filter::Gaussian;
use dynocar_core::filter::adjoint::{ForwardStep, smooth_means};
use dynocar_core::filter::lanes;
use dynocar_core::filter::particle::{ParticleModel, ParticleSmoother};
use dynocar_core::filter::random::Random;
use dynocar_core::pipeline::braking::engine::EngineError;
use dynocar_core::pipeline::braking::motion::State;
use nalgebra::{SMatrix, SVector};

use super::window::{Statistics, WindowModel};

const DISTANCE: usize = State::Distance as usize;

/// A way to take the expectation.
pub trait Expectation: Send {
    /// Gradient and curvature of Q at the model's share.
    ///
    /// # Errors
    ///
    /// When no particle is left, or a factorisation fails.
    fn expect(&mut self, model: &WindowModel<'_>) -> Result<Statistics, EngineError>;

    /// The belief about the state of a step before its measurement, from the last E-step.
    fn predicted(&self, step: usize) -> Option<Gaussian<2>>;
}

/// The papers' E-step: particle filter and marginal particle smoother.
#[derive(Clone, Debug)]
pub struct ParticleExpectation {
    smoother: ParticleSmoother<2>,
    random: Random,
}

impl ParticleExpectation {
    /// Room for a number of particles over a window, and the seed of all randomness.
    pub fn new(particles: usize, window_steps: usize, seed: u64) -> Self {
        ParticleExpectation {
            smoother: ParticleSmoother::new(particles, window_steps),
            random: Random::new(seed),
        }
    }

    /// Mean of distance and speed at a step given the whole window, from the last E-step.
    #[cfg(test)]
    pub fn smoothed_mean(&self, step: usize) -> Option<[f64; 2]> {
        self.smoother.smoothed_moments(step).map(|(mean, _)| mean)
    }
}

impl ParticleModel<2> for WindowModel<'_> {
    fn draw_initial(&self, random: &mut Random) -> [f64; 2] {
        let Gaussian { mean, covariance } = &self.window.first;
        let (x, y) = (random.normal(), random.normal());
        // Cholesky factor of the 2 by 2 covariance.
        let distance_std = covariance[(0, 0)].max(0.0).sqrt();
        let slope = if distance_std > 0.0 { covariance[(1, 0)] / distance_std } else { 0.0 };
        let rest = (covariance[(1, 1)] - slope * slope).max(0.0).sqrt();
        [mean[0] + distance_std * x, mean[1] + slope * x + rest * y]
    }

    fn advance(&self, step: usize) -> impl Fn([f64; 2]) -> [f64; 2] {
        let mover = self.mover(step);
        move |state| mover(state).0
    }

    fn draw_noise(&self, step: usize) -> impl Fn(&mut Random) -> [f64; 2] {
        let [distance, speed] = self.move_noise(step).stds;
        move |random| {
            let (x, y) = (random.normal(), random.normal());
            [distance * x, speed * y]
        }
    }

    fn transition_densities(
        &self,
        step: usize,
        advanced: [&[f64]; 2],
        successors: [&[f64]; 2],
        densities: &mut [f64],
    ) {
        let [distance, speed] =
            self.move_noise(step).precisions.map(|precision| -0.5 * LOG2_E * precision);
        let [distances, speeds] = successors;
        let rows = densities.chunks_exact_mut(distances.len());
        for ((row, from_m), from_mps) in rows.zip(advanced[0]).zip(advanced[1]) {
            for ((density, to_m), to_mps) in row.iter_mut().zip(distances).zip(speeds) {
                let (off_m, off_mps) = (to_m - from_m, to_mps - from_mps);
                *density = distance * off_m * off_m + speed * off_mps * off_mps;
            }
        }
        for density in densities {
            *density = lanes::exp2_nonpositive(*density);
        }
    }

    fn log_likelihood(&self, step: usize) -> impl Fn([f64; 2]) -> f64 {
        let measured_m = self.window.entries[step].observed.distance_m;
        let scale = -0.5 / self.noise.measured_distance_m2;
        move |[distance_m, _]| {
            let off_m = measured_m - distance_m;
            scale * off_m * off_m
        }
    }
}

impl Expectation for ParticleExpectation {
    fn expect(&mut self, model: &WindowModel<'_>) -> Result<Statistics, EngineError> {
        self.smoother.filter(model, model.window.entries.len(), &mut self.random)?;
        let mut statistics = Statistics::default();
        self.smoother.smooth(model)?;
        for step in 0..model.window.entries.len().saturating_sub(1) {
            if let Some(deviation) = self.smoother.mean_deviation(step) {
                model.accumulate(step, deviation, &mut statistics);
            }
        }
        Ok(statistics)
    }

    fn predicted(&self, step: usize) -> Option<Gaussian<2>> {
        let (mean, covariance) = self.smoother.predicted_moments(step)?;
        Some(Gaussian {
            mean: SVector::from(mean),
            covariance: SMatrix::from_fn(|i, j| covariance[i][j]),
        })
    }
}

/// The exact E-step for the Gaussian model: Kalman filter and its adjoint. Q needs the smoothed
/// means only.
#[derive(Clone, Debug)]
pub struct KalmanExpectation {
    forward: Vec<ForwardStep<2>>,
    smoothed: Vec<SVector<f64, 2>>,
}

impl KalmanExpectation {
    /// Room for a window.
    pub fn new(window_steps: usize) -> Self {
        KalmanExpectation {
            forward: Vec::with_capacity(window_steps),
            smoothed: vec![SVector::zeros(); window_steps],
        }
    }

    /// Mean of distance and speed at a step given the whole window, from the last E-step.
    #[cfg(test)]
    pub fn smoothed_mean(&self, step: usize) -> Option<[f64; 2]> {
        (step < self.forward.len()).then(|| self.smoothed[step].into())
    }

    fn filter(&mut self, model: &WindowModel<'_>) -> Result<(), EngineError> {
        self.forward.clear();
        let mut state = model.window.first;
        for (step, entry) in model.window.entries.iter().enumerate() {
            let mut jacobian = SMatrix::<f64, 2, 2>::identity();
            if let Some(before) = step.checked_sub(1) {
                let (mean, speed_by_speed) = model.advance(before, state.mean.into());
                jacobian[(0, 1)] = 0.5 * entry.inputs.step_s * (1.0 + speed_by_speed);
                jacobian[(1, 1)] = speed_by_speed;
                let added =
                    SMatrix::from_diagonal(&SVector::from(model.move_noise(before).variances));
                state.predict(SVector::from(mean), &jacobian, &added);
            }
            let predicted = state;
            let variance = model.noise.measured_distance_m2;
            let innovation = state.innovation(DISTANCE, entry.observed.distance_m, variance)?;
            state.take(DISTANCE, &innovation, variance);
            let (component, filtered) = (DISTANCE, state);
            self.forward.push(ForwardStep { predicted, filtered, component, innovation, jacobian });
        }
        Ok(())
    }
}

impl Expectation for KalmanExpectation {
    fn expect(&mut self, model: &WindowModel<'_>) -> Result<Statistics, EngineError> {
        self.filter(model)?;
        let count = self.forward.len();
        smooth_means(&self.forward, &mut self.smoothed[..count]);
        let mut statistics = Statistics::default();
        for step in 0..count.saturating_sub(1) {
            let (advanced, _) = model.advance(step, self.smoothed[step].into());
            let next = self.smoothed[step + 1];
            let deviation = [next[0] - advanced[0], next[1] - advanced[1]];
            model.accumulate(step, deviation, &mut statistics);
        }
        Ok(statistics)
    }

    fn predicted(&self, step: usize) -> Option<Gaussian<2>> {
        self.forward.get(step).map(|forward| forward.predicted)
    }
}
