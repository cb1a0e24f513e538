//! Linear estimators that the pipelines share.
//!
//! - [`drifting_level`]: least squares beside a level that may drift, as square-root information
//! - [`joseph`]: a small Kalman filter in Joseph's form

pub mod drifting_level;
pub mod joseph;

pub use drifting_level::DriftingLevel;
pub use joseph::JosephFilter;
