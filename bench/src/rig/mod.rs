//! What latency and load measurements share: a place of their own, processes, traffic.
//!
//! - [`site`]: a run-time directory with a daemon, gone afterwards
//! - [`cores`]: cores and priorities, and what the host takes away from them
//! - [`motion`]: the samples of a train that swings between 10 and 30 m/s
//! - [`pipelines`]: which pipelines a measurement names
//! - [`quantiles`]: histograms and what is reported of them
//! - [`usage`]: what the kernel says of a process: processor time, memory, faults, switches

pub mod cores;
pub mod motion;
pub mod pipelines;
pub mod quantiles;
pub mod site;
pub mod usage;
