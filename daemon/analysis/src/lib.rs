//! Analysis of recorded runs.
//!
//! It knows no channel, clock, file, thread or logger: texts, times and seeds come in as
//! arguments, and what does not depend on each other is said to whoever gives it threads (decision 0018). Laws, forces, simulation and estimators are [`dynocar_core`]'s, which knows nothing
//! of this library: what is found in recordings is what the daemon then applies.
//!
//! # Layout, in the order of the work
//!
//! - [`import`]: trains and lines from other projects' files
//! - [`dataset`]: recorded runs, from texts to the samples that a controller would publish; a library of its own
//! - [`identify`]: the daemon's pipelines over recorded runs
//! - [`survey`]: a line and its gradient from recordings with GNSS
//! - [`stops`]: a brake of unknown force, from recorded stops
//! - [`brakes`]: the same brake as train protection asks for it
//! - [`explain`]: the undeclared effect that explains the residual of the declared model
//! - [`driven`]: the train itself, force in and speed out, by the law that `explain` predicts with
//! - [`advice`]: the next manoeuvre, by which the estimates become sharper
//! - [`statistics`]: the middle of values, their root mean square, their span, lists in order
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
