//! The pipeline `residual_monitor`: which force the model does not explain, and what it may be.
//!
//! Momentum blocks make a linear regression in a, b, c and what is not exactly known of the
//! forces, as in [`crate::pipeline::momentum`]. Each suspect adds one column: what one unit of
//! it would take off the momentum. All columns go through one whitener and into one information
//! matrix, from which the likelihood ratio of every suspect against the base model follows at
//! any time, a, b and c being refitted together with it. The distance by position against the distance by
//! speed adds the wheels' diameter.
//!
//! # Layout, in the order a sample takes
//!
//! - `settings`: thresholds and noise
//! - `suspects`: the effects that are looked for; `usual`: how far off everything may be
//! - `covariates`, `place_memory`, `pressure`, `wheel_scale`: what a sample says of each of them
//! - `rows`: blocks to independent rows of unit variance
//! - `onsets`: since when a brake may drag
//! - `information`: the likelihood ratios
//! - `verdict`: what speaks for each of them
//! - `naming`: who is suspected, what is hardly distinguishable from it, and when it has ended
//! - `estimator`: the pipeline around all of it

mod covariates;
mod estimator;
mod information;
mod naming;
mod onsets;
mod place_memory;
mod pressure;
mod rows;
mod settings;
mod suspects;
mod usual;
mod verdict;
mod wheel_scale;

pub use estimator::ResidualMonitor;
pub use settings::MonitorSettings;
