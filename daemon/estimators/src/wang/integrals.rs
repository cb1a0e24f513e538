//! The regression that results from integrating the equation of motion.
//!
//! With u = m_ref / m, q = g / (1000 (1 + gamma)) and the coefficients theta of z1, z2, z3,
//!
//! ```text
//! v(t) + q ∫ known dt = level + u ∫ F / (m_ref (1 + gamma)) dt - q Σ theta_j ∫ phi_j(v) dt
//! ```
//!
//! where `known` is the gradient and every declared resistance beyond the basic one, so that z2 and z3 are the
//! resistance of curves and tunnels beyond the declared one.
//!
//! Wang 2022 fits eq. (11)-(18) to a differentiated speed, whose noise at 5 Hz is five hundred times the acceleration
//! that 0.02 N/kN causes. The integrals express the same equation with the noise of the speed itself: white, and once
//! per sample.

use dynocar_core::filter::DriftingLevel;
use dynocar_core::filter::drifting_level::{DriftStep, LEVEL, PARAMETERS};
use dynocar_model::train::TrainModel;
use nalgebra::SVector;

use super::force_model::{BiasModel, MapError, SpeedBasis};
use super::known_motion::{Inertia, KnownMotion};

/// Resistance in N/kN that a curve or a tunnel typically adds.
const TYPICAL_N_PER_KN: f64 = 5.0;

/// Number of unknowns: level, bias, inverse mass, z1, z2, z3.
pub const UNKNOWNS: usize = 12;
/// Index of the reference mass over the mass.
pub const INVERSE_MASS: usize = PARAMETERS;
/// Places where the coefficients of z1, z2 and z3 begin.
pub const POLYNOMIALS: [usize; 3] = [PARAMETERS + 1, PARAMETERS + 4, PARAMETERS + 7];

/// A value for each unknown.
pub type RegressorRow = SVector<f64, UNKNOWNS>;

/// Conversion of a motion into rates of the integrals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regressors {
    /// Speed polynomials.
    pub basis: SpeedBasis,
    /// Inertia of the train.
    pub inertia: Inertia,
    /// Radius in m that z2 refers to.
    pub reference_radius_m: f64,
}

impl Regressors {
    /// For a train; speeds are normalised by its highest.
    pub fn new(train: &TrainModel, reference_radius_m: f64) -> Self {
        Regressors {
            basis: SpeedBasis::new(train.speed_max_mps().filter(|&v| v > 5.0).unwrap_or(40.0)),
            inertia: Inertia::from_train(train),
            reference_radius_m,
        }
    }

    /// Returns how fast the integrals grow.
    pub fn rates(&self, motion: &KnownMotion) -> Integrals {
        let unit_mps2 = self.inertia.mps2_per_n_per_kn();
        let phi = self.basis.at(motion.speed_mps) * unit_mps2;
        let shares = [1.0, self.reference_radius_m * motion.curvature_per_m, motion.tunnel_share];
        let mut row = RegressorRow::zeros();
        row[INVERSE_MASS] = self.inertia.push_mps2(motion);
        for (at, share) in POLYNOMIALS.into_iter().zip(shares) {
            row.fixed_rows_mut::<3>(at).copy_from(&(phi * -share));
        }
        let known_mps = unit_mps2 * motion.known_n_per_kn;
        let tied = motion.known_n_per_kn + TYPICAL_N_PER_KN * (shares[1] + shares[2]);
        Integrals { row, known_mps, tied_mps: unit_mps2 * tied }
    }
}

/// Integrals since the start of an unbroken piece of motion, or their rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrals {
    /// Of the factor of each parameter, in m/s; 0 at the level.
    row: RegressorRow,
    /// Of the deceleration by gradient and declared resistance, in m/s.
    known_mps: f64,
    /// Of the size that accelerations tied to the place may have, in m/s.
    tied_mps: f64,
}

impl Integrals {
    /// At the start.
    pub fn zero() -> Self {
        Integrals { row: RegressorRow::zeros(), known_mps: 0.0, tied_mps: 0.0 }
    }

    /// Moves on by a step between two rates (trapezoid).
    pub fn add(&mut self, from: &Integrals, to: &Integrals, step_s: f64) {
        self.row += (from.row + to.row) * (0.5 * step_s);
        self.known_mps += 0.5 * step_s * (from.known_mps + to.known_mps);
    }

    /// Replaces the rate at the end of the last step.
    pub fn correct(&mut self, instead_of: &Integrals, rates: &Integrals, step_s: f64) {
        self.row += (rates.row - instead_of.row) * (0.5 * step_s);
    }

    /// Changes between two rates, in m/s²: of the accelerations tied to the place, and of the
    /// force's on the reference mass.
    pub fn changes(from: &Integrals, to: &Integrals) -> [f64; 2] {
        [to.tied_mps - from.tied_mps, to.row[INVERSE_MASS] - from.row[INVERSE_MASS]]
    }

    /// Returns the equation of a measured speed: row and value.
    pub fn equation(&self, speed_mps: f64) -> (RegressorRow, f64) {
        let mut row = self.row;
        row[LEVEL] = 1.0;
        (row, speed_mps + self.known_mps)
    }
}

/// A step of time between two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegralStep {
    /// Its length in s.
    pub step_s: f64,
    /// Speed in m/s at its start.
    pub speed_mps: f64,
    /// Change of the force's acceleration over it in m/s².
    pub push_change_mps2: f64,
    /// Effect of the map's error.
    pub map: MapError,
    /// Variance in (m/s)² of the noise of the level under any assumption.
    pub noise_variance: f64,
}

/// Expectation of a measured speed by a regression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedSpeed {
    /// Measured minus predicted speed over its standard deviation.
    pub normalised: f64,
    /// Measured minus predicted speed in m/s.
    pub error_mps: f64,
    /// Measured minus filtered speed in m/s.
    pub residual_mps: f64,
    /// Variance of the filtered speed in (m/s)².
    pub filtered_variance: f64,
}

/// The regression under its assumption.
#[derive(Clone, Debug)]
pub struct BiasHypothesis {
    model: BiasModel,
    /// The regression.
    pub regression: DriftingLevel<UNKNOWNS>,
}

impl BiasHypothesis {
    /// Returns a regression that starts from prior knowledge.
    pub fn new(model: BiasModel, mean: &RegressorRow, std: &RegressorRow) -> Self {
        let mut regression = DriftingLevel::new(mean, std);
        regression.restart_bias(model.std_mps2);
        BiasHypothesis { model, regression }
    }

    /// Bias in m/s² at a speed for a stated bias of 1 m/s².
    pub fn shape(&self, speed_mps: f64) -> f64 {
        self.model.shape(speed_mps)
    }

    /// Opens the mass by a standard deviation relative to the reference.
    pub fn reopen(&mut self, relative_std: f64) {
        let variance = relative_std * relative_std;
        self.regression.widen_first_parameter(variance, self.model.std_mps2);
    }

    /// Begins on a map whose gradient errs, with a bias of which nothing is known.
    pub fn begin_on_map(&mut self, map: &MapError, speed_mps: f64) {
        self.regression.restart_bias(self.model.std_given_others_mps2(map.std_mps2, speed_mps));
    }

    /// Moves on by a step of time.
    pub fn propagate(&mut self, step: &IntegralStep) {
        let keep = self.model.keep(step.step_s);
        let (keep, noise_variance) = self.model.drift(keep, &step.map, step.speed_mps);
        let jump_variance = self.model.jump_variance(step.push_change_mps2, step.step_s);
        self.regression.propagate(&DriftStep {
            gain: step.step_s * self.model.shape(step.speed_mps),
            keep,
            noise_variance,
            level_noise_variance: step.noise_variance + jump_variance,
        });
    }

    /// Returns the expectation of an equation of a measured speed with a noise variance.
    pub fn expect(&self, row: &RegressorRow, value: f64, noise_variance: f64) -> ExpectedSpeed {
        let innovation = self.regression.clone().absorb(row, value, 1.0 / noise_variance);
        let normalised = innovation.normalised.unwrap_or(0.0);
        let variance_ratio = innovation.log_variance_ratio.exp();
        let error_mps = normalised * (noise_variance * variance_ratio).sqrt();
        ExpectedSpeed {
            normalised,
            error_mps,
            residual_mps: error_mps / variance_ratio,
            filtered_variance: noise_variance * (1.0 - 1.0 / variance_ratio),
        }
    }

    /// Absorbs an equation; returns the logarithm of its likelihood, up to a constant that all assumptions share.
    pub fn absorb(&mut self, row: &RegressorRow, value: f64, weight: f64) -> f64 {
        let innovation = self.regression.absorb(row, value, weight);
        let evidence =
            |normalised: f64| -0.5 * (normalised * normalised + innovation.log_variance_ratio);
        innovation.normalised.map_or(0.0, evidence)
    }
}
