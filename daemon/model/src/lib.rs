//! Declared model of a train and its line, and the forces that follow from it, without side effects.
//!
//! Every part of the project that learns, explains or simulates stands on this library: the live estimators
//! (`dynocar_core`), the papers' methods, the reader of recorded runs, the analysis, the daemon.
//! It estimates nothing, and knows no channel, clock, file, thread or logger: times come in as arguments.
//!
//! # Layout, in the order in which a sample passes
//!
//! - [`units`]: the units that quantities may be in
//! - [`train`], [`track`]: the declared train and line
//! - [`terms`]: the physical terms of the model, one law each, that all of the following share
//! - [`force`]: the known forces on the train at a sample
//! - [`simulate`]: the speed that a force model predicts over a recorded run
//! - [`words`]: the words of every answer: kinds of effects, their numbers and places
//! - [`named!`]: enums whose members have names in files

pub mod force;
mod named;
pub mod simulate;
pub mod terms;
pub mod track;
pub mod train;
pub mod units;
pub mod words;
