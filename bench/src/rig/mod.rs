//! Tools for measurements of processes: separate run-time directories, cores, pipelines, histograms.
//!
//! - [`site`]: a run-time directory with a daemon, removed afterwards
//! - [`cores`]: cores and priorities
//! - [`pipelines`]: the pipelines that a measurement names
//! - [`quantiles`]: histograms and their reported quantiles
//! - [`usage`]: the kernel's counters of a process: processor time, memory, waits

pub mod cores;
pub mod pipelines;
pub mod quantiles;
pub mod site;
pub mod usage;
