//! Davis coefficients by fitting a computed speed trajectory to the measured one (Xia 2023).
//!
//! - [`step`]: how a train moves over one step, with derivatives
//! - [`motion`]: from resolved samples to steps
//! - [`deviation`], [`wolfe_newton`]: the paper's method, with its formulas corrected
//! - [`integral_start`], [`residuals`], [`fit`]: ours, offline and over windows
//! - [`hypothesis`], [`bank`], [`noise`], [`online`]: ours, sample by sample
//! - [`quality`]: what an estimate is worth

pub mod bank;
pub mod dataset;
pub mod deviation;
pub mod fit;
pub mod hypothesis;
pub mod index;
pub mod integral_start;
pub mod kalman;
pub mod long_run;
pub mod motion;
pub mod noise;
pub mod online;
pub mod quality;
pub mod residuals;
pub mod step;
pub mod unexplained;
pub mod wolfe_newton;
