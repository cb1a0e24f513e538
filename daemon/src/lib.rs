//! The programs next to a controller: the daemon, its command line and its files.
//!
//! # Layout
//!
//! - [`cli`]: the commands of `dynocar`, one file each
//! - [`config`]: the daemon's configuration, and its pipelines
//! - [`dataset`]: recorded runs from disk
//! - [`ending`]: when a long-running program ends
//! - [`log`]: the daemon's log, which nobody has to wait for, and the changes that it reports
//! - [`models`]: a store of models
//! - [`observing`]: observation of trains, in one vocabulary
//! - [`operator`]: texts for an operator, in one place
//! - [`output`]: where results go; lines on a terminal that later lines replace
//! - [`programs`]: commands that are programs of their own, and their failures
//! - [`demo`]: the main job as a demonstration
//! - [`run`]: the daemon, every stage on one screen
//! - [`runtime`]: its threads
//! - [`shadow`]: models on trial, and the change from one to another
//! - [`stamp`]: moments whose age does not depend on changes of the wall clock
//! - [`state`]: estimates that outlive the daemon
//! - [`storage`]: files that are replaced as a whole
//! - [`supervision`]: health and metrics of the daemon, for supervisors and operators
//! - [`text_file`]: text files from disk
//! - [`replay`]: recorded runs into the sample channel
//!
//! # Examples
//!
//! ```
//! let commands = dynocar::cli::commands();
//! assert!(commands.find_subcommand("explain").is_some());
//! ```

pub mod cli;
pub mod config;
pub mod dataset;
pub mod demo;
pub mod ending;
pub mod log;
pub mod models;
pub mod observing;
pub mod operator;
pub mod output;
pub mod programs;
pub mod replay;
pub mod run;
pub mod runtime;
pub mod shadow;
pub mod stamp;
pub mod state;
pub mod storage;
pub mod supervision;
pub mod text_file;
