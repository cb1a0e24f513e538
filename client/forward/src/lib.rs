//! `dynocar forward`: what the daemon knows of its trains, to an MQTT 5 broker as Sparkplug B.
//!
//! It is one reader of the snapshots of each train, as every client is, and touches no control cycle.
//! One thread reads the channels and makes publications, whatever the broker does; another sends them. Between
//! them lies a queue that drops the oldest when it is full, and counts what it drops.
//!
//! # Layout
//!
//! - [`cli`]: the command line
//! - [`payload`]: Sparkplug's payload as protobuf messages
//! - [`fields`]: what of a snapshot becomes which metric
//! - [`train`]: a train's metrics as they are now, and which of them have changed
//! - [`watcher`]: trains that are observed, and what is made of it
//! - [`queue`]: publications that wait for the broker
//! - [`node`]: topics, births, deaths and sequence numbers of the edge node, without any socket
//! - [`broker`]: one connection to the broker
//! - [`forwarder`]: connections one after the other, until asked to end

pub mod broker;
#[cfg(test)]
mod broker_tests;
pub mod cli;
pub mod fields;
pub mod forwarder;
#[cfg(test)]
mod library_tests;
pub mod node;
pub mod payload;
pub mod queue;
pub mod train;
pub mod watcher;
