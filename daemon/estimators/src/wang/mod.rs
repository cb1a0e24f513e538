//! Wang 2022: resistance on open track, in curves and in tunnels, and the mass: the paper's method, and ours for a
//! train of which one of the two is known exactly. Where neither is known, [`dynocar_core::pipeline::train_kalman`] is
//! better.
//!
//! - `descent`, `staged`: the paper's stages, by normalised gradient descent on sums over all samples
//! - [`JointLeastSquares`]: resistances and mass together, on [`integrals`] of motion
//! - [`MassKalman`]: the mass by Kalman filters [v, 1/m, bias], a [`bias_bank`] of them
//! - [`known_motion`], [`force_model`]: the values taken from a sample, and the parts of the model

pub mod bias_bank;
mod descent;
pub mod force_model;
pub mod integrals;
mod joint;
mod joint_snapshot;
mod kalman;
mod kalman_settings;
pub mod known_motion;
mod staged;

pub use joint::{JointLeastSquares, JointLeastSquaresSettings};
pub use kalman::MassKalman;
pub use kalman_settings::MassKalmanSettings;
pub use staged::{MassRegression, StagedDescent, StagedDescentSettings};
