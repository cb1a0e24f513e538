//! `dynocar watch`: what the daemon knows of its trains, live in a terminal, and what to drive next.
//!
//! It is one reader of the snapshots of each train, as every client is, and touches no control
//! cycle.
//!
//! # Layout
//!
//! - [`cli`]: the command line
//! - [`watcher`]: trains that are observed, and what is shown of them
//! - [`state`]: a train as it is shown and its last minutes, without any clock or channel
//! - [`advisor`]: what to drive next, now and then
//! - [`words`]: numbers with intervals and units, a train's lines
//! - [`screen`]: the screen, drawn from a [`state`]
//! - [`plain`]: lines where there is no terminal
//! - [`terminal`]: keys, signals, and a terminal left as it was

pub mod advisor;
pub mod cli;
pub mod plain;
pub mod screen;
pub mod state;
pub mod terminal;
pub mod watcher;
pub mod words;
