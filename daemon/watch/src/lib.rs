//! `dynocar watch`: the daemon's estimates of its trains, live in a terminal, and the next manoeuvre to drive.
//!
//! It is one reader of the snapshots of each train, as every client is, and delays no control cycle.
//!
//! # Layout
//!
//! - [`cli`]: the command line; keys, signals, and a terminal left as it was; lines where there is no terminal
//! - [`watcher`]: the observed trains, and the state of each that is shown
//! - [`state`]: the shown state of a train and its last minutes, without any clock or channel; advice on the next
//!   manoeuvre
//! - [`words`]: numbers with intervals and units, a train's lines
//! - [`screen`]: the screen, drawn from a [`state`]
//!
//! # Examples
//!
//! ```
//! // The command line, as the program parses it.
//! let command = dynocar_watch::cli::command();
//! assert!(command.try_get_matches_from(["program", "--no-such-option"]).is_err());
//! ```

pub mod cli;
pub mod screen;
pub mod state;
pub mod watcher;
pub mod words;
