//! State estimation without physics.
//!
//! - [`kalman`]: Gaussian state, scalar measurements in Joseph form
//! - [`fixed_lag`]: what later measurements say of an earlier state, without a backward pass
//! - [`rts`]: fixed-interval smoothing by Rauch, Tung and Striebel
//! - [`lanes`]: sums and powers over slices
//! - [`random`]: the seeded generator behind every sampling estimator
//! - [`particle`]: particle filter and the marginal particle smoother

pub mod fixed_lag;
pub mod kalman;
pub mod lanes;
pub mod particle;
pub mod random;
pub mod rts;
