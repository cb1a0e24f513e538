//! Recursive estimators and solvers of fixed size, without any knowledge of trains.
//!
//! Sizes are const generics, memory is the structs' own, and no update allocates. Each is
//! tested against its batch least-squares twin.
//!
//! - `rls`, `mils`, `information`, `bounded`: least squares, recursive, with bounds
//! - `whitening`, `line`, `median`: from raw rows to independent, clean ones
//! - [`triangular`]: least-squares rows gathered in a triangular factor by Householder reflections
//! - [`levenberg_marquardt`]: small nonlinear least squares in a box
//! - [`square_root`]: covariance as a triangular factor, updated by one measurement at a time
//! - [`drifting_level`]: least squares beside a level that may drift, as square-root information
//! - `joint_state`: a state beside constant parameters, in square-root form
//! - [`joseph`]: a small Kalman filter in Joseph's form
//! - [`kalman`]: Gaussian state, scalar measurements in Joseph form
//! - [`fixed_lag`]: what later measurements say of an earlier state, without a backward pass
//! - [`adjoint`]: fixed-interval smoothing without an inverse (Bryson and Frazier)
//! - [`particle`], [`random`]: particle filter, marginal particle smoother and their seeded generator
//! - [`lanes`]: sums and powers over slices; `rank_one`: the covariance after a scalar measurement

pub mod adjoint;
#[cfg(test)]
mod batch_twin;
mod bounded;
pub mod drifting_level;
pub mod fixed_lag;
mod information;
mod joint_state;
pub mod joseph;
pub mod kalman;
pub mod lanes;
pub mod levenberg_marquardt;
mod line;
mod median;
mod mils;
pub mod particle;
pub mod random;
mod rank_one;
mod rls;
pub mod square_root;
pub mod triangular;
mod whitening;

pub use bounded::{Bounded, bounded_minimum};
pub use drifting_level::DriftingLevel;
pub use information::SquareRootInformation;
pub use joint_state::JointState;
pub use joseph::JosephFilter;
pub use line::Line;
pub use median::RunningMedian;
pub use mils::{Mils, Penalty};
pub use rls::{Forgetting, Rls, Step};
pub use whitening::{Propagation, Sighting, Whitener};

/// A factorisation failed: a matrix that should be positive definite is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a positive definite matrix of finite numbers, found none")]
pub struct NotPositiveDefinite;
