//! The daemon, its command line and its files.
//!
//! - [`dataset`]: recorded runs on disk
//! - [`cli`]: the commands of `dynocar`, one file each

pub mod cli;
pub mod dataset;
