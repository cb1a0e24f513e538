//! Davis coefficients by fitting a computed speed trajectory to the measured one; the paper's method is in
//! [`super`].
//!
//! - [`step`]: how a train moves over one step, with derivatives
//! - [`motion`]: from resolved samples to steps
//! - [`residuals`], [`fit`]: Dynocar's own method, offline and over windows
//! - [`hypothesis`], [`noise`], [`online`]: Dynocar's own method, sample by sample
//! - [`quality`]: whether an estimate may be used
//! - [`A`], [`B`], [`C`], [`SPEED`]: indices in vectors and matrices

pub mod fit;
pub mod hypothesis;
pub mod kalman;
pub mod motion;
pub mod noise;
pub mod online;
pub mod quality;
pub mod residuals;
mod search;
pub mod step;
#[cfg(test)]
mod tests;

/// Davis a.
pub const A: usize = 0;
/// Davis b.
pub const B: usize = 1;
/// Davis c.
pub const C: usize = 2;
/// The speed, last: a step changes only the last row of a triangular factor then.
pub const SPEED: usize = 3;
