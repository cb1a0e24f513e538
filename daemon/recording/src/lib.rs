//! The recorder of what a controller and the daemon write.
//!
//! # Layout
//!
//! - [`train_channels`]: what a recorder and a live view read of the trains' channels
//! - [`record`]: the recorder
//! - [`page`]: the reference page of the recorded fields
//! - [`cli`]: the command line

pub mod cli;
pub mod page;
pub mod record;
pub mod train_channels;
