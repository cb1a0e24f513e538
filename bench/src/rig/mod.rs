//! Tools that measurements of processes need: a place of their own, cores, pipelines, histograms.
//!
//! - [`site`]: a run-time directory with a daemon, gone afterwards
//! - [`cores`]: cores and priorities
//! - [`pipelines`]: which pipelines a measurement names
//! - [`quantiles`]: histograms and their reported quantiles
//! - [`usage`]: the kernel's counters of a process: processor time, memory, waits

pub mod cores;
pub mod pipelines;
pub mod quantiles;
pub mod site;
pub mod usage;
