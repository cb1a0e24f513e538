//! The daemon, its command line and its files.
//!
//! - [`cli`]: the commands of `dynocar`, one file each

pub mod cli;
