//! The recorder of samples and snapshots.
//!
//! # Layout
//!
//! - [`train_channels`]: reader of the trains' channels for a recorder and a live view
//! - [`record`]: the recorder
//! - [`page`]: the reference page of the recorded fields
//! - [`cli`]: the command line
//!
//! # Examples
//!
//! ```
//! // The command line, as the program parses it.
//! let command = dynocar_recording::cli::command();
//! assert!(command.try_get_matches_from(["program", "--no-such-option"]).is_err());
//! ```

pub mod cli;
pub mod page;
pub mod record;
pub mod train_channels;
