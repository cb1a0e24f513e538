//! Sliding-window expectation maximisation (Xie 2019, section 2; Jin 2020, section 3).
//!
//! The steps are the papers'; this module differs where the printed form cannot work:
//!
//! - The process noise in the E- and M-steps is Gaussian with the variance of the papers'
//!   uniform noise. With the uniform density itself, Q is constant where it is finite, and that
//!   is an interval of about 1e-5 around the old value: the M-step never moves. The Gaussian
//!   makes the M-step, eq. (29)-(33), a weighted least-squares problem with a closed form.
//! - The motion is that of [`dynocar_core::pipeline::braking::motion`], without the cap min(F(mu), B), unless
//!   [`EmSettings::has_printed_cap`] asks for it.
//! - An estimate belongs to the middle of its window; attributed to the end, as printed, it
//!   lags behind a changing coefficient by half a window.
//! - The first state of a window, whose density I_1 needs and the papers do not give, is the
//!   filter's prediction from the window before.

mod expectation;
mod sliding;

pub use expectation::{
    Expectation, KalmanExpectation, ObservedWindow, ParticleExpectation, Statistics, WindowModel,
};
pub use sliding::{EStep, EmSettings, EmWindow};

#[cfg(test)]
mod tests;
