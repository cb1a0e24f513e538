//! Recordings as Parquet, without loss and back; and Parquet files of anybody as columns of numbers.
//!
//! A recording is a folder: one file of samples for each train, one of snapshots for each pipeline, one
//! of events, one each of what an MCAP file has attached and as metadata. `message_number` says in which order
//! the messages were recorded. A file of samples alone is a recording too: it carries the configuration.
//!
//! # Layout
//!
//! - [`cells`]: the columns of `dynocar_mcap::columns` as Arrow has them
//! - [`error`]: why a file cannot be read, and how a damaged file affects its library
//! - [`writing`]: MCAP to Parquet
//! - [`reading`], [`table`]: Parquet to what a recording holds, and to MCAP
//! - [`numbers`]: a Parquet file of anybody as columns of numbers, and whose its rows are
//! - [`cli`]: the command line

pub mod cells;
pub mod cli;
pub mod error;
pub mod numbers;
pub mod reading;
pub mod table;
pub mod writing;
