//! The open loop that latency and load measure by: samples leave at their appointed times, even if earlier answers are
//! missing, through real processes on cores of their own.
//!
//! - [`traffic`]: a train's samples, when they leave, and which are bad
//! - [`wire`]: the controller's end of each transport, and the alternatives to shared memory
//! - [`controller`]: sends the samples that are due, and counts the answers
//! - [`trial`]: the answering side, the number of trains, and the outcome
//! - [`server`]: the answering processes
//! - `zeromq`: ZeroMQ, with the feature of that name

pub mod controller;
pub mod server;
pub mod traffic;
pub mod trial;
pub mod wire;
#[cfg(feature = "zeromq")]
pub mod zeromq;
