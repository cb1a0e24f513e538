//! Mass, and the resistances that have to be known for it; the paper's method is in
//! [`super::papers::wang`].
//!
//! # Layout
//!
//! - [`motion`], [`inertia`], [`section`], [`line_resistance`], [`speed_basis`], [`bias_model`]: what a sample
//!   gives, and the parts of the model
//! - [`JointLeastSquares`]: resistance and mass together, on [`integrals`] of motion
//! - [`MassKalman`]: mass by Kalman filters [v, 1/m, bias], a [`bias_bank`] of them

pub mod bias_bank;
pub mod bias_model;
mod hypothesis;
pub mod inertia;
pub mod integrals;
mod joint;
mod joint_settings;
mod joint_snapshot;
mod kalman;
mod kalman_settings;
pub mod line_resistance;
pub mod motion;
pub mod section;
mod settling;
pub mod speed_basis;

pub use joint::JointLeastSquares;
pub use joint_settings::JointLeastSquaresSettings;
pub use kalman::MassKalman;
pub use kalman_settings::MassKalmanSettings;
