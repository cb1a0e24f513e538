//! The regression that the equation of motion becomes when it is integrated.
//!
//! With u = m_ref / m, q = g / (1000 (1 + gamma)) and the coefficients theta of z1, z2, z3,
//!
//! ```text
//! v(t) + q ∫ gradient dt = level + u ∫ F / (m_ref (1 + gamma)) dt - q Σ theta_j ∫ phi_j(v) dt
//! ```
//!
//! Wang 2022 fits eq. (11)-(18) to a differentiated speed, whose noise at 5 Hz is five hundred
//! times the acceleration that 0.02 N/kN makes. The integrals hold the same equation with the
//! noise of the speed itself: white, and once per sample.

use dynocar_shared::resistance::STANDARD_GRAVITY_MPS2;
use nalgebra::SVector;

use super::motion::Motion;
use super::speed_basis::SpeedBasis;
use crate::filter::drifting_level::{LEVEL, PARAMETERS};
use crate::train::TrainModel;

/// Number of unknowns: level, bias, inverse mass, z1, z2, z3.
pub const UNKNOWNS: usize = 12;
/// Place of the reference mass over the mass.
pub const INVERSE_MASS: usize = PARAMETERS;
/// Places where the coefficients of z1, z2 and z3 begin.
pub const POLYNOMIALS: [usize; 3] = [PARAMETERS + 1, PARAMETERS + 4, PARAMETERS + 7];

/// A value for each unknown.
pub type Row = SVector<f64, UNKNOWNS>;

/// What turns a motion into rates of the integrals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regressors {
    /// Speed polynomials.
    pub basis: SpeedBasis,
    /// Mass in kg that the inverse mass refers to.
    pub reference_mass_kg: f64,
    /// 1 + gamma.
    pub inertia_factor: f64,
    /// Radius in m that z2 refers to.
    pub reference_radius_m: f64,
}

impl Regressors {
    /// For a train; speeds are normalised by its highest.
    pub fn new(train: &TrainModel, reference_radius_m: f64) -> Self {
        Regressors {
            basis: SpeedBasis::new(train.speed_max_mps().filter(|&v| v > 5.0).unwrap_or(40.0)),
            reference_mass_kg: train.mass_kg,
            inertia_factor: 1.0 + train.rotating_mass_factor,
            reference_radius_m,
        }
    }

    /// m/s² of one N/kN.
    pub fn mps2_per_n_per_kn(&self) -> f64 {
        1e-3 * STANDARD_GRAVITY_MPS2 / self.inertia_factor
    }

    /// How fast the integrals grow.
    pub fn rates(&self, motion: &Motion) -> Integrals {
        let phi = self.basis.at(motion.speed_mps) * self.mps2_per_n_per_kn();
        let shares = [1.0, self.reference_radius_m * motion.curvature_per_m, motion.tunnel_share];
        let mut row = Row::zeros();
        row[INVERSE_MASS] = motion.force_n / (self.reference_mass_kg * self.inertia_factor);
        for (at, share) in POLYNOMIALS.into_iter().zip(shares) {
            row.fixed_rows_mut::<3>(at).copy_from(&(phi * -share));
        }
        Integrals { row, gradient_mps: self.mps2_per_n_per_kn() * motion.gradient_permille }
    }
}

/// Integrals since the start of an unbroken piece of motion, or their rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrals {
    /// Of what each parameter multiplies, in m/s; 0 at the level.
    row: Row,
    /// Of the gradient's deceleration, in m/s.
    gradient_mps: f64,
}

impl Integrals {
    /// At the start.
    pub fn zero() -> Self {
        Integrals { row: Row::zeros(), gradient_mps: 0.0 }
    }

    /// Moves on by a step between two rates (trapezoid).
    pub fn add(&mut self, from: &Integrals, to: &Integrals, step_s: f64) {
        self.row += (from.row + to.row) * (0.5 * step_s);
        self.gradient_mps += 0.5 * step_s * (from.gradient_mps + to.gradient_mps);
    }

    /// The equation of a measured speed: row and value.
    pub fn equation(&self, speed_mps: f64) -> (Row, f64) {
        let mut row = self.row;
        row[LEVEL] = 1.0;
        (row, speed_mps + self.gradient_mps)
    }
}
