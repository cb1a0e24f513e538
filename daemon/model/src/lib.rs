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
//!
//! # Examples
//!
//! ```
//! use dynocar_model::train::{Davis, TrainModel};
//!
//! let resistance = Davis { a: 1.5, b: 0.01, c: 0.0005 };
//! let train = TrainModel::bare("metro", 200_000.0, resistance);
//! // 1.5 + 0.01 · 20 + 0.0005 · 20² N/kN at 20 m/s
//! assert!((train.resistance.w0_n_per_kn(20.0) - 1.9).abs() < 1e-12);
//! ```

pub mod force;
mod named;
pub mod simulate;
pub mod terms;
pub mod track;
pub mod train;
pub mod units;
pub mod words;
