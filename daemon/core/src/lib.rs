//! What runs beside a controller: physics and statistics, pure.
//!
//! It knows no channel, clock, file, thread or logger: times and seeds come in as arguments. The
//! daemon runs these pipelines online, `dynocar identify` offline; both get the same bits from the
//! same samples. What recorded runs show beyond that is the library `dynocar_analysis`'s, which is
//! built on this one.
//!
//! # Layout, in the order a sample takes
//!
//! - [`units`]: the units that quantities may be in
//! - [`train`], [`track`]: what is declared of the train and the line
//! - [`validation`]: which samples are fit for use, and why the others are not
//! - [`plausibility`]: whether samples can be true: units, exchanged forces, signs
//! - [`terms`]: the physical terms of the model, one law each, that all of the following share
//! - [`force`]: the known forces on the train at a sample
//! - [`filter`]: recursive estimators of fixed size, without knowledge of trains
//! - [`pipeline`]: estimators behind one interface, from sample to snapshot
//! - [`simulate`]: the speed that a force model predicts over a recorded run
//! - [`trial`]: which of several models predicts better, judged while a train runs
//! - [`remedy`]: what a person does about a reason or a refused sample
//! - [`named!`]: enums whose members have names in files

pub mod filter;
pub mod force;
mod named;
pub mod pipeline;
pub mod plausibility;
pub mod remedy;
pub mod simulate;
pub mod terms;
pub mod track;
pub mod train;
pub mod trial;
pub mod units;
pub mod validation;
