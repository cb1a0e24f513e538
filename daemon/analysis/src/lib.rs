//! Analysis of recorded runs.
//!
//! Texts, times and seeds are arguments, and independent work is given to the caller's threads (decision 0018): the
//! library knows no channel, clock, file, thread or logger. Laws, forces and simulation come from [`dynocar_model`],
//! filters and pipelines from [`dynocar_core`], estimators from [`dynocar_estimators`]. None of these knows this
//! library, and the daemon applies the effects that it finds in recordings.
//!
//! # Layout, in the order of the work
//!
//! - [`import`]: trains and lines from other projects' files
//! - [`dataset`]: recorded runs, from texts to the samples that a controller would publish; a library of its own
//! - [`identify`]: the daemon's pipelines over recorded runs
//! - [`survey`]: a line and its gradient from recordings with GNSS
//! - [`stops`]: a brake of unknown force, from recorded stops
//! - [`brakes`]: the same brake in the form that train protection requires
//! - [`explain`]: the undeclared effect that explains the residual of the declared model
//! - [`driven`]: the train itself, force in and speed out, by the law that `explain` predicts with
//! - [`advice`]: the next manoeuvre, which narrows the estimates
//! - [`statistics`]: medians, root mean squares and spans of values, and sorted lists
//! - [`parallel`]: work on all threads

pub mod advice;
pub mod brakes;
pub mod driven;
pub mod explain;
pub mod identify;
pub mod import;
pub mod parallel;
pub mod statistics;
pub mod stops;
pub mod survey;

pub use dynocar_dataset as dataset;
