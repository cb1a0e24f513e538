//! The recorder of samples and snapshots.
//!
//! # Layout
//!
//! - [`train_channels`]: reader of the trains' channels for a recorder and a live view
//! - [`record`]: the recorder
//! - [`page`]: the reference page of the recorded fields
//! - [`cli`]: the command line

pub mod cli;
pub mod page;
pub mod record;
pub mod train_channels;
