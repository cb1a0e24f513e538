//! Recordings of what a controller and the daemon write, as [MCAP](https://mcap.dev) files with
//! protobuf messages.
//!
//! Samples are the truth of a recording: the daemon's pipelines are functions of them, so that every
//! snapshot can be computed again, and is, by `dynocar replay --verify`.
//!
//! # Layout
//!
//! - [`schema`]: the protobuf messages, made from the layouts of sample and snapshot
//! - [`columns`]: the same as columns of tables, for whoever writes tables
//! - [`page`]: the reference page of the recorded fields
//! - [`codec`]: samples and snapshots as messages, and back, to the bit
//! - [`event`]: what happens around them
//! - [`message`]: messages that are declared once
//! - [`topic`]: the streams of messages, and the messages
//! - [`train_channels`]: what a recorder and a live view read of the trains' channels
//! - [`writing`], [`reading`]: MCAP files, written without seeking and read as far as they are whole
//! - [`joining`]: the files of a recording that rotated, read as one
//! - [`recording`], `order`: a recording in memory, in the order in which it was recorded
//! - [`record`]: the recorder
//! - [`copying`]: copies of recordings, ours or not: a broken file made whole
//! - [`error`]: what is wrong with a file, and which
//! - [`annotate`]: an explanation beside the data
//! - [`convert`]: recordings to datasets and back
//! - [`dataset`]: the dataset at a path, be it a folder or a recording
//! - [`verify`]: every recorded snapshot computed again
//! - [`cli`]: the command line

pub mod annotate;
pub mod cli;
pub mod codec;
pub mod columns;
pub mod convert;
pub mod copying;
pub mod dataset;
pub mod error;
pub mod event;
pub mod joining;
pub mod message;
mod order;
pub mod page;
pub mod reading;
pub mod record;
pub mod recording;
pub mod schema;
pub mod topic;
pub mod train_channels;
pub mod verify;
pub mod writing;
