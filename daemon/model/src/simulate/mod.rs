//! The forward simulation of a train: the speed that a force model predicts.
//!
//! ```text
//! mass (1 + gamma) dv/dt = traction - brake - weight_kN (w0(v) + k mean(1/R) + tunnel)
//!                          - weight_kN gradient + other forces of the force model
//! ```
//!
//! Over a recorded run ([`OpenLoopRecording`], [`Prediction`]) the simulation is open loop: the reported forces act,
//! the track is looked up at the measured position, the predicted speed is compared with the measured one. It is the
//! judge of every model, and an optimiser calls it thousands of times. Simulators of driven trains, which look the
//! track up at the simulated position, use the same step and the same elements ([`motion`]).
//!
//! # Integration
//!
//! Heun's method, second order. Between two samples the acceleration at a fixed speed is linear in time, so the
//! reported forces enter by the trapezoidal rule, which is exact for them. The remaining error comes from the change of
//! resistance within a step: with d(dv/dt)/dv = -lambda, a step h errs by about (lambda h)²/6 of the step's change of
//! speed; lambda is below 0.01 1/s on a train, so that this is below 2e-5 at h = 1 s, and longer steps are divided.
//!
//! # Standstill
//!
//! Resistance and brakes only oppose motion, so a train never rolls backwards: the speed is kept at or above zero, the
//! instant of stopping and of starting is found within the step, and the time at rest adds nothing.
//! [`OpenLoopRecording`] describes the further treatment of stops and gaps.

pub mod motion;
mod prediction;
mod recording;
#[cfg(test)]
mod tests;

pub use prediction::{MOVING_SPEED_MPS, Prediction, Restart, STANDING_MPS, SpeedError, departs};
pub use recording::{
    ForceModel, OpenLoopRecording, Polynomial, QuadraticForces, SimulateError, declared_polynomial,
    is_pulled,
};
