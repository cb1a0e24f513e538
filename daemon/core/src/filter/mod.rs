//! Solvers that know no train: least squares and filters in square-root form.
//!
//! - [`triangular`]: least-squares rows gathered in a triangular factor by Householder reflections
//! - [`levenberg_marquardt`]: small nonlinear least squares in a box
//! - [`square_root`]: covariance as a triangular factor, updated by one measurement at a time

pub mod levenberg_marquardt;
pub mod square_root;
pub mod triangular;
