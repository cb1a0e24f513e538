//! Recursive estimators and solvers of fixed size, without any knowledge of trains.
//!
//! Sizes are const generics, memory is the structs' own, and no update allocates. Each estimator is tested against its
//! batch least-squares twin.
//!
//! - [`gaussian`]: a belief in covariance form, measured by Joseph's form where subtraction would
//!   cost digits; `rank_one` is its arithmetic
//! - [`square_root`]: a belief whose covariance is stored as a triangular factor
//! - `information`, [`triangular`]: a belief in square-root information form; [`drifting_level`] is
//!   one with a level that may drift
//! - `rls`, `mils`, `bounded`: least squares, recursive, with bounds
//! - `whitening`, `straight_line`, `median`: from raw rows to independent, clean ones
//! - [`levenberg_marquardt`]: small nonlinear least squares in a box
//! - [`fixed_lag`]: estimates of an earlier state by later measurements, either without a backward pass or by one that
//!   inverts no covariance (Bryson and Frazier)
//! - [`particle`], [`random`]: particle filter, marginal particle smoother and their seeded generator
//! - [`bank`]: hypotheses side by side, weighed by evidence, and beliefs mixed by weight
//! - [`lanes`]: sums and powers over slices

pub mod bank;
mod bounded;
pub mod drifting_level;
pub mod fixed_lag;
pub mod gaussian;
mod information;
pub mod lanes;
pub mod levenberg_marquardt;
mod median;
mod mils;
pub mod particle;
pub mod random;
mod rank_one;
mod rls;
pub mod square_root;
mod straight_line;
#[cfg(test)]
mod test_runs;
pub mod triangular;
mod whitening;

pub use bank::Bank;
pub use bounded::{Bounded, bounded_minimum};
pub use drifting_level::DriftingLevel;
pub use gaussian::{Gaussian, Innovation};
pub use information::SquareRootInformation;
pub use median::RunningMedian;
pub use mils::{Mils, Penalty};
pub use rls::Rls;
pub use straight_line::FittedLine;
pub use whitening::{Propagation, Sighting, UnitRow, Whitener};

/// A belief or a measurement is not sound: a matrix that should be positive definite is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a positive definite matrix of finite numbers, found none")]
pub struct NotPositiveDefinite;
