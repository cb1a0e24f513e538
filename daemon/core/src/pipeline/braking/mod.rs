//! Coefficients that only braking shows: adhesion (Xie 2019), disc friction and braking ratio
//! (Jin 2020).
//!
//! # Layout
//!
//! - [`law`], [`motion`]: the braking train
//! - [`intake`]: from the train's samples to observations and steps of a braking
//! - [`engine`]: common parts of the estimators
//! - [`tracker`]: the papers' extended Kalman filter, and our fixed-lag smoother
//! - [`law_bank`]: known laws, scaled and weighed by evidence
//! - [`estimator`]: from an engine to a snapshot
//! - [`settings`]: the pipelines by name
//!
//! The papers' sliding-window expectation maximisation is an engine of its own, in `dynocar_estimators`.

pub mod engine;
pub mod estimator;
pub mod intake;
pub mod law;
pub mod law_bank;
pub mod motion;
pub mod settings;
pub mod tracker;
