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
//! - [`joseph`]: a small Kalman filter in Joseph's form

mod bounded;
pub mod drifting_level;
mod information;
pub mod joseph;
pub mod levenberg_marquardt;
mod line;
mod median;
mod mils;
mod rls;
pub mod square_root;
pub mod triangular;
mod whitening;

pub use bounded::{Bounded, bounded_minimum};
pub use drifting_level::DriftingLevel;
pub use information::SquareRootInformation;
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
