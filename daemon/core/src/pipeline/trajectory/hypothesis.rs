//! A Kalman filter of [a, b, c, v] under one hypothesis about the last jump of (a, b, c).

use nalgebra::{Matrix3, SVector, Vector3};

use super::index::{A, B, C, SPEED};
use super::noise::{LearnedNoise, NoiseModel};
use super::step::{Step, StepRule};
use crate::filter::square_root::CovarianceFactor;
use crate::train::Davis;

/// How often measured speeds are wrong, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierModel {
    /// Share of outliers.
    pub share: f64,
    /// Density of an outlier's innovation in s/m, flat.
    pub density: f64,
}

/// State, covariance and weight under one hypothesis.
///
/// The state is extended over a step by the step's derivatives; the covariance factor stays
/// triangular without a factorisation, since a step moves the speed alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis {
    /// a, b, c and v in the order of [`super::index`].
    pub state: SVector<f64, 4>,
    /// Factor of their covariance.
    pub factor: CovarianceFactor<4>,
    /// Noise as it was learned under the hypothesis.
    pub noise: LearnedNoise,
    /// Logarithm of the hypothesis' probability.
    pub log_weight: f64,
    /// Time in s since its jump.
    pub age_s: f64,
    /// Measurements left out in a row.
    refusals: u32,
}

/// After so many measurements left out in a row the speed is taken from the next.
const REFUSALS_MAX: u32 = 10;

/// What a measured speed said under a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted speed in m/s.
    pub innovation_mps: f64,
    /// Its predicted standard deviation in m/s.
    pub deviation_mps: f64,
    /// False when the measurement was taken for an outlier and left out.
    pub is_used: bool,
}

impl Hypothesis {
    /// Coefficients of given mean and standard deviations, with a speed of no meaning yet.
    pub fn new(davis: &Davis, std: &Vector3<f64>, noise: LearnedNoise) -> Self {
        Hypothesis {
            state: SVector::<f64, 4>::new(davis.a, davis.b, davis.c, 0.0),
            factor: CovarianceFactor::diagonal(&SVector::<f64, 4>::new(
                std[A], std[B], std[C], 1.0,
            )),
            noise,
            log_weight: 0.0,
            age_s: 0.0,
            refusals: 0,
        }
    }

    /// The coefficients.
    pub fn davis(&self) -> Davis {
        Davis { a: self.state[A], b: self.state[B], c: self.state[C] }
    }

    /// Covariance of the coefficients.
    pub fn davis_covariance(&self) -> Matrix3<f64> {
        let lower = self.factor.0.fixed_view::<3, 3>(0, 0);
        lower * lower.transpose()
    }

    /// Takes the speed from a measurement alone; the coefficients keep what they know.
    pub fn anchor(&mut self, speed_mps: f64) {
        self.state[SPEED] = speed_mps;
        for column in [A, B, C] {
            self.factor.0[(SPEED, column)] = 0.0;
        }
        self.factor.0[(SPEED, SPEED)] = self.noise.speed_variance.sqrt();
        self.noise.anchor();
        self.refusals = 0;
    }

    /// Lets the coefficients jump by an unknown amount of given covariance diagonal; `false`
    /// when the covariance cannot be factored.
    pub fn jump(&mut self, variance: &Vector3<f64>) -> bool {
        let mut covariance = self.factor.covariance();
        for i in [A, B, C] {
            covariance[(i, i)] += variance[i];
        }
        match CovarianceFactor::of(&covariance) {
            Some(factor) => {
                self.factor = factor;
                self.age_s = 0.0;
                true
            }
            None => false,
        }
    }

    /// Moves the state over a step of a given time.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn predict(&mut self, rule: StepRule, step: &Step, duration_s: f64) {
        let (advance, _) = rule.advance_or_crawl(step, &self.davis(), self.state[SPEED]);
        self.state[SPEED] = advance.speed_mps;
        let lower = &mut self.factor.0;
        for column in [A, B, C] {
            let mut entry = advance.by_speed * lower[(SPEED, column)];
            for row in column..SPEED {
                entry += advance.by_davis[row] * lower[(row, column)];
            }
            lower[(SPEED, column)] = entry;
        }
        let own = advance.by_speed * lower[(SPEED, SPEED)];
        lower[(SPEED, SPEED)] = (own * own + self.noise.disturbance_density * duration_s).sqrt();
        self.noise.predict(advance.by_speed, duration_s);
        self.age_s += duration_s;
    }

    /// Takes in a measured speed, or leaves it out when it more likely is an outlier; the
    /// weight gains the likelihood of either.
    ///
    /// # Real-time
    ///
    /// Bounded work, no allocation.
    pub fn measure(
        &mut self,
        measured_mps: f64,
        model: &NoiseModel,
        outliers: &OutlierModel,
    ) -> Innovation {
        let own_variance = self.factor.0.row(SPEED).norm_squared();
        let noise_variance = self.noise.speed_variance;
        let variance = own_variance + noise_variance;
        let innovation_mps = measured_mps - self.state[SPEED];
        let normal = (-0.5 * innovation_mps * innovation_mps / variance).exp()
            / (std::f64::consts::TAU * variance).sqrt();
        let inlier = (1.0 - outliers.share) * normal;
        let outlier = outliers.share * outliers.density;
        self.log_weight += (inlier + outlier).ln();
        let is_used = inlier >= outlier;
        self.noise.learn(innovation_mps, own_variance, is_used, model);
        self.refusals = if is_used { 0 } else { self.refusals + 1 };
        if is_used {
            let mut direction = SVector::<f64, 4>::zeros();
            direction[SPEED] = 1.0;
            let gain = self.factor.measure(&direction, noise_variance).gain;
            self.state += gain * innovation_mps;
        } else if self.refusals > REFUSALS_MAX {
            self.anchor(measured_mps);
        }
        Innovation { innovation_mps, deviation_mps: variance.sqrt(), is_used }
    }

    /// Mean and covariance of two hypotheses by their weights, with the weight of both; the
    /// rest is the likelier's.
    ///
    /// The spread between them stays in the covariance: neither knows exactly when the jump
    /// was, and samples from before it would bias the coefficients.
    pub fn united(&self, other: &Hypothesis) -> Hypothesis {
        let (more, less) =
            if self.log_weight >= other.log_weight { (self, other) } else { (other, self) };
        let odds = (less.log_weight - more.log_weight).exp();
        let share = odds / (1.0 + odds);
        let apart = less.state - more.state;
        let covariance = more.factor.covariance() * (1.0 - share)
            + less.factor.covariance() * share
            + apart * apart.transpose() * (share * (1.0 - share));
        let mut united = *more;
        united.log_weight += odds.ln_1p();
        if let Some(factor) = CovarianceFactor::of(&covariance) {
            united.state += apart * share;
            united.factor = factor;
        }
        united
    }

    /// True while state and covariance are numbers.
    pub fn is_sound(&self) -> bool {
        self.state.iter().all(|entry| entry.is_finite())
            && self.log_weight.is_finite()
            && self.factor.is_sound()
    }
}
