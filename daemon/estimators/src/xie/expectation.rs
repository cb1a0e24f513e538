//! The E-step: the distribution of a window's states under a value of the coefficient, and its moments for the M-step.

use std::f64::consts::LOG2_E;

use dynocar_core::filter::fixed_lag::{ForwardStep, smooth_means};
use dynocar_core::filter::particle::{ParticleModel, ParticleSmoother};
use dynocar_core::filter::random::Random;
use dynocar_core::filter::{Gaussian, lanes};
use dynocar_core::pipeline::braking::engine::BrakingObservation;
use dynocar_core::pipeline::braking::motion::{self, DISTANCE, MotionNoise, StepInputs};
use nalgebra::{SMatrix, SVector};

/// A method for the expectation.
pub trait Expectation: Send {
    /// Returns the gradient and curvature of Q at the model's share of the demand.
    ///
    /// # Errors
    ///
    /// When no particle is left, or a factorisation fails.
    fn expect(&mut self, model: &WindowModel<'_>) -> Option<Statistics>;

    /// Returns the belief about the state of a step before its measurement, from the last E-step.
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
    fn expect(&mut self, model: &WindowModel<'_>) -> Option<Statistics> {
        self.smoother.filter(model, model.window.entries.len(), &mut self.random).ok()?;
        let mut statistics = Statistics::default();
        self.smoother.smooth(model).ok()?;
        for step in 0..model.window.entries.len().saturating_sub(1) {
            if let Some(deviation) = self.smoother.mean_deviation(step) {
                model.accumulate(step, deviation, &mut statistics);
            }
        }
        Some(statistics)
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

    fn filter(&mut self, model: &WindowModel<'_>) -> Option<()> {
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
            let innovation =
                state.innovation(DISTANCE, entry.observed.distance_m, variance).ok()?;
            state.take(DISTANCE, &innovation, variance);
            let (component, filtered) = (DISTANCE, state);
            self.forward.push(ForwardStep { predicted, filtered, component, innovation, jacobian });
        }
        Some(())
    }
}

impl Expectation for KalmanExpectation {
    fn expect(&mut self, model: &WindowModel<'_>) -> Option<Statistics> {
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
        Some(statistics)
    }

    fn predicted(&self, step: usize) -> Option<Gaussian<2>> {
        self.forward.get(step).map(|forward| forward.predicted)
    }
}

/// Statistics of the E-step for the M-step: dQ/d share and -d²Q/d share² at the present value, the share being the
/// coefficient over the demand. Only I_2, the moves, depends on it (Xie 2019, eq. 30-32: I_1 and I_3 vanish).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Gradient of Q.
    pub gradient: f64,
    /// Curvature of Q, never negative.
    pub curvature: f64,
}

impl Statistics {
    /// Returns the step to the maximum: Q is quadratic in the share, so that the papers' gradient
    /// search (Xie 2019, eq. 33; Jin 2020, eq. 29) ends after this one step. 0 where Q does not
    /// depend on the coefficient.
    pub fn newton_step(&self) -> f64 {
        if self.curvature > 0.0 { self.gradient / self.curvature } else { 0.0 }
    }
}

/// One observation with the step that led to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedStep {
    /// The known motion since the entry before.
    pub inputs: StepInputs,
    /// Measured values.
    pub observed: BrakingObservation,
    /// The process noise of that step.
    pub noise: MoveNoise,
}

/// Process noise of distance and speed over one step, ready for use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveNoise {
    /// Variances in m² and (m/s)².
    pub variances: [f64; 2],
    /// Their roots.
    pub stds: [f64; 2],
    /// Their inverses.
    pub precisions: [f64; 2],
}

impl MoveNoise {
    /// Returns the noise of a step; of no step, nothing that could be divided by zero.
    pub fn over(noise: &MotionNoise, step_s: f64) -> Self {
        let variances = [noise.distance_m2_per_s, noise.speed_m2_per_s3].map(|rate| rate * step_s);
        let precisions =
            variances.map(|variance| if variance > 0.0 { 1.0 / variance } else { 0.0 });
        MoveNoise { variances, stds: variances.map(f64::sqrt), precisions }
    }
}

/// Observations of a window and the belief about its first state.
#[derive(Clone, Debug)]
pub struct ObservedWindow {
    /// In order of time; the first entry's inputs lead into the window.
    pub entries: Vec<ObservedStep>,
    /// Distance in m and speed in m/s at the first entry, before its measurement.
    pub first: Gaussian<2>,
}

/// A window with a value of the coefficient: the input of an E-step.
///
/// The coefficient is kept as its share of the demand, which is the same thing while the cylinder
/// pressure is constant, as in the papers, and stays constant while the brake is being applied.
#[derive(Clone, Copy, Debug)]
pub struct WindowModel<'a> {
    /// The window.
    pub window: &'a ObservedWindow,
    /// Noise of motion and measurement.
    pub noise: &'a MotionNoise,
    /// The coefficient over the demand.
    pub share: f64,
    /// See [`super::EmSettings::has_printed_cap`].
    pub has_printed_cap: bool,
}

impl WindowModel<'_> {
    /// Returns the share that acts, and its derivative by the share: above 1 the printed cap lets exactly the demand
    /// act.
    pub fn acting(&self) -> (f64, f64) {
        if self.has_printed_cap && self.share >= 1.0 { (1.0, 0.0) } else { (self.share, 1.0) }
    }

    /// Distance and speed after the move that starts at `step`, without noise, and the
    /// derivative of the final speed by the first.
    pub fn advance(&self, step: usize, state: [f64; 2]) -> ([f64; 2], f64) {
        self.mover(step)(state)
    }

    /// [`WindowModel::advance`] for any number of states.
    #[inline]
    pub fn mover(&self, step: usize) -> impl Fn([f64; 2]) -> ([f64; 2], f64) + use<> {
        let inputs = self.window.entries[step + 1].inputs;
        let (share, _) = self.acting();
        // The law is the demand itself.
        let law = (inputs.demand, 0.0);
        move |[distance_m, speed_mps]| {
            let moved = motion::advance_under(&inputs, law, speed_mps, share);
            ([distance_m + moved.travelled_m, moved.speed_mps], moved.speed_by_speed)
        }
    }

    /// Returns the derivatives of distance and speed after a move by the share.
    pub fn by_share(&self, step: usize) -> [f64; 2] {
        let inputs = &self.window.entries[step + 1].inputs;
        let speed = -inputs.step_s * inputs.gain_mps2 * inputs.demand * self.acting().1;
        [0.5 * inputs.step_s * speed, speed]
    }

    /// Returns the process noise of the move that starts at `step`.
    pub fn move_noise(&self, step: usize) -> &MoveNoise {
        &self.window.entries[step + 1].noise
    }

    /// Adds to the M-step by how much the states deviate, on average over the E-step, from the
    /// noise-free move that starts at `step`.
    pub fn accumulate(&self, step: usize, deviation: [f64; 2], into: &mut Statistics) {
        let slopes = self.by_share(step);
        let precisions = self.move_noise(step).precisions;
        for ((slope, precision), deviation) in slopes.into_iter().zip(precisions).zip(deviation) {
            into.curvature += slope * slope * precision;
            into.gradient += slope * deviation * precision;
        }
    }
}
