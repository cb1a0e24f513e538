//! The known forces on a train.
//!
//! The declared model, all in N, along the direction of travel:
//!
//! ```text
//! mass (1 + gamma) dv/dt = traction - brake
//!                          - weight_kN (w0(v) + k mean(1/R) + tunnel_constant tunnel_length)
//!                          - weight_kN gradient
//! ```
//!
//! with the gradient in ‰ and the means taken along the train. [`ForceResolver`] gives
//! everything but w0(v), which is what the estimators look for; [`balance`] says what all of it accelerates.
//! Each part is a law of [`crate::terms`], with what is declared of it in the train and the line.

pub mod balance;
mod resolver;

pub use resolver::{ForceResolver, ResolvedSample, ValidSample};
