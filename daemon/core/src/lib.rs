//! The pure library of Dynocar: physics and statistics.
//!
//! It knows no channel, clock, file, thread or logger: texts, times and seeds come in as
//! arguments. The daemon runs these pipelines online, `dynocar identify` offline; both get the
//! same bits from the same samples.
//!
//! # Layout, in the order a sample takes
//!
//! - [`train`], [`track`]: what is declared of the train and the line
//! - [`dataset`]: recorded runs, from texts to the samples that a controller would publish
//! - [`validation`]: which samples are fit for use, and why the others are not
//! - [`plausibility`]: whether samples can be true: units, exchanged forces, signs
//! - [`terms`]: the physical terms of the model, one law each, that all of the following share
//! - [`force`]: the known forces on the train at a sample
//! - [`filter`]: recursive estimators of fixed size, without knowledge of trains
//! - [`pipeline`]: estimators behind one interface, from sample to snapshot
//! - [`simulate`]: the speed that a force model predicts over a recorded run
//! - [`stops`]: what recorded stops say of a brake of unknown force
//! - [`survey`]: a line and its gradient from recordings with GNSS
//! - [`explain`]: which undeclared effect explains what the declared model leaves
//! - [`trial`]: which of several models predicts better, told while a train runs
//! - [`driven`]: the train itself, force in and speed out, by the law that `explain` predicts with
//! - [`advice`]: what to drive next, so that the estimates become sharper
//! - [`import`]: trains and lines from other projects' files

pub mod advice;
pub mod dataset;
pub mod driven;
pub mod explain;
pub mod filter;
pub mod force;
pub mod import;
mod named;
pub mod pipeline;
pub mod plausibility;
pub mod simulate;
pub mod stops;
pub mod survey;
pub mod terms;
pub mod track;
pub mod train;
pub mod trial;
pub mod validation;
