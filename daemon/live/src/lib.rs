//! `dynocar live`: samples and snapshots served to viewers as they come, by the Foxglove WebSocket protocol.
//!
//! Topics, schemas and messages are those of a recording (`dynocar_mcap`), and the same readers read the channels: a
//! viewer sees the same as a recorder, but it gets only as many samples as a picture needs.
//!
//! # Layout
//!
//! - [`live`]: reads the channels and serves until it is asked to end
//! - [`viewers`]: channels that are advertised while somebody writes them, their messages, the number of samples that
//!   viewers get, and reports about viewers that do not keep up
//! - [`cli`]: the command line
//!
//! # Examples
//!
//! ```
//! // The command line, as the program parses it.
//! let command = dynocar_live::cli::command();
//! assert!(command.try_get_matches_from(["program", "--no-such-option"]).is_err());
//! ```

pub mod cli;
pub mod live;
pub mod viewers;
