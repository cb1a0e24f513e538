//! Mass, and the resistances that have to be known for it (Wang 2022).
//!
//! # Layout
//!
//! - [`motion`], [`section`], [`line_resistance`], [`speed_basis`], [`bias_model`]: what a sample
//!   gives, and the parts of the model
//! - [`StagedDescent`]: the paper's stages, by normalised gradient descent on sums over all
//!   samples
//! - [`JointLeastSquares`]: resistance and mass together, on [`integrals`] of motion
//! - [`MassKalman`]: mass by Kalman filters [v, 1/m, bias], a [`bias_bank`] of them

pub mod bias_bank;
pub mod bias_model;
mod descent;
mod hypothesis;
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
mod speed_noise;
mod staged;
mod staged_settings;

pub use joint::JointLeastSquares;
pub use joint_settings::JointLeastSquaresSettings;
pub use kalman::MassKalman;
pub use kalman_settings::MassKalmanSettings;
pub use staged::StagedDescent;
pub use staged_settings::{MassRegression, StagedDescentSettings};
