//! Davis coefficients by fitting a computed speed trajectory to the measured one; the paper's method is in
//! [`super`].
//!
//! - [`step`]: how a train moves over one step, with derivatives
//! - [`motion`]: from resolved samples to steps
//! - [`integral_start`], [`residuals`], [`fit`]: ours, offline and over windows
//! - [`hypothesis`], [`bank`], [`noise`], [`online`]: ours, sample by sample
//! - [`quality`]: what an estimate is worth

pub mod bank;
pub mod fit;
mod fit_settings;
pub mod hypothesis;
pub mod index;
pub mod integral_start;
pub mod kalman;
pub mod long_run;
pub mod motion;
pub mod noise;
pub mod online;
#[cfg(test)]
mod pipeline_tests;
pub mod quality;
pub mod residuals;
mod search;
pub mod step;
#[cfg(test)]
mod test_runs;
pub mod unexplained;
mod unit_disturbance;
