//! Models on trial: which of several models predicts a train's motion better, judged while it runs.
//!
//! The model in force and its rivals predict the same samples open loop, restarted every 60 s
//! ([`ledger::OpenLoop`], by the simulation that judges every model, [`dynocar_model::simulate`]). Trip by trip
//! their errors are compared, and the comparison is a bet whose winnings say at every moment how sure one may be
//! ([`evidence`]): one may look as often as one likes. The errors by day and place are kept next to it ([`ledger`]).
//!
//! This module knows no threads, files or clocks; `dynocar` runs it next to the pipelines.

pub mod evidence;
pub mod ledger;
#[cfg(test)]
mod tests;
mod trials;

pub use trials::{ModelTrials, Rival};
