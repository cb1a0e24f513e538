//! Recursive estimators and solvers of fixed size, without any knowledge of trains.
//!
//! Sizes are const generics, memory is the structs' own, and no update allocates. Each estimator is tested against its
//! batch least-squares twin.
//!
//! - [`gaussian`]: a belief in covariance form, measured by Joseph's form where subtraction would
//!   cost digits; [`covariance`] is its arithmetic, and a covariance that is stored as a triangular factor
//! - `rows`, [`triangular`]: raw rows made independent, and a belief in square-root information form;
//!   [`drifting_level`] is one with a level that may drift
//! - `least_squares`, `mils`: least squares, recursive, with bounds
//! - `statistics`: the median of the newest values, and a straight line through points
//! - [`levenberg_marquardt`]: small nonlinear least squares in a box
//! - [`fixed_lag`]: estimates of an earlier state by later measurements, either without a backward pass or by one that
//!   inverts no covariance (Bryson and Frazier)
//! - [`particle`], [`random`]: particle filter, marginal particle smoother and their seeded generator
//! - [`bank`]: hypotheses side by side, weighed by evidence, and beliefs mixed by weight
//! - [`lanes`]: sums and powers over slices

pub mod bank;
pub mod covariance;
pub mod drifting_level;
pub mod fixed_lag;
pub mod gaussian;
pub mod lanes;
mod least_squares;
pub mod levenberg_marquardt;
mod mils;
pub mod particle;
pub mod random;
mod rows;
mod statistics;
#[cfg(test)]
mod test_runs;
pub mod triangular;

pub use bank::Bank;
pub use drifting_level::DriftingLevel;
pub use gaussian::{Gaussian, Innovation};
pub use least_squares::{Bounded, Rls, bounded_minimum};
pub use mils::{Mils, Penalty};
pub use rows::{Propagation, Sighting, SquareRootInformation, UnitRow, Whitener};
pub use statistics::{FittedLine, RunningMedian};

/// A belief or a measurement is not sound: a matrix that should be positive definite is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a positive definite matrix of finite numbers, found none")]
pub struct NotPositiveDefinite;
