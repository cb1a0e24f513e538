//! The workshop: work on recorded runs and files, apart from the controller.
//!
//! It reads and writes through the daemon's library, so that both understand a file alike; the daemon knows only the
//! name of the workshop's program.
//!
//! # Layout
//!
//! - [`brakes_page`]: the parameters of a brake as a page of HTML
//! - [`cli`]: its commands, one file each
//! - [`convert`]: recordings to datasets, in memory or in a folder
//! - [`dataset`]: the dataset at a path, be it a folder or a recording; a dataset as a recording
//! - [`formats`]: the libraries of the formats that are not text
//! - [`learn`]: recorded runs into candidates for the store
//! - [`updated`]: the model with its effects as train and track files, and a dataset of them
//! - [`report`]: an explanation as a page of HTML
//! - [`run_facts`]: facts and notes on a recorded run
//! - [`survey`]: raw recordings to a dataset on a surveyed line
//! - [`verify`]: every recorded snapshot computed again
//!
//! # Examples
//!
//! ```
//! use dynocar_workshop::cli::execute;
//!
//! // Every command of the program can be called from Rust as well.
//! assert!(execute(["check", "no-such-folder"]).is_err());
//! ```

pub mod brakes_page;
pub mod cli;
pub mod convert;
pub mod dataset;
pub mod formats;
pub mod learn;
pub mod report;
pub mod run_facts;
pub mod survey;
pub mod updated;
pub mod verify;
