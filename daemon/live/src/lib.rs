//! `dynocar live`: what a controller and the daemon write, served to viewers as it comes, by the
//! Foxglove WebSocket protocol.
//!
//! Topics, schemas and messages are those of a recording (`dynocar_mcap`), and the channels are
//! read by the same readers: what is seen live is what would be recorded, but for the samples, of which
//! viewers get as many as a picture needs.
//!
//! # Layout
//!
//! - [`live`]: reads the channels and serves until it is asked to end
//! - [`viewers`]: channels that are advertised while somebody writes them, and their messages
//! - [`thinning`]: how many samples viewers get
//! - [`slow_viewers`]: what is reported of viewers
//! - [`cli`]: the command line

pub mod cli;
pub mod live;
pub mod slow_viewers;
pub mod thinning;
pub mod viewers;
