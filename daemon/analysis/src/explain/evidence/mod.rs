//! Evidence of the runs on a model: observations, their noise, and the joint fit.
//!
//! The measured speed is compared with the integral of the modelled acceleration, never differentiated. Samples, whose
//! outliers have been replaced before, are averaged in bins of about two seconds. The residual of the model is a random
//! process: measurement noise on top of the integral of an unmodelled force. A Kalman filter of that process turns the
//! bins' differences into white innovations, for residuals and regressors alike, so that the fit is a least-squares
//! problem under any noise.

mod adjoint;
mod bins;
mod criterion;
mod drift;
mod fit;
mod integral;
mod loads;
mod model;
mod noise;
mod noise_search;
mod positions;
mod run_data;
mod run_scatter;
mod sample_forces;
mod slides;
mod thinning;
mod whitener;

pub use adjoint::Adjoint;
pub use bins::Bin;
pub use criterion::{
    CERTAIN_STDS, CERTAIN_STDS_BY_RUN, EQUAL, NULL_SCORE, NullScore, OUTSIDE_COST, SCORE_MIN,
    acceptance_score, p_value,
};
pub use fit::{Fit, FitProblem, Positions, RunNormal, RunPositions};
pub use model::{UpdatedForces, UpdatedModel};
pub use noise::{Fade, Noise, RunScatter};
pub use noise_search::{RUNS_A_TASK, coarse_step};
pub use run_data::{Density, RunData, RunDataError, RunPower, prepare, prepare_at};
pub use run_scatter::{PRIOR_RUNS, RunFactors, WeightedFilter};
pub use sample_forces::SampleForces;
#[cfg(test)]
pub use sample_forces::test_runs::coasting;
pub use whitener::BinWhitener;
