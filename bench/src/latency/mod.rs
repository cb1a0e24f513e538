//! `dynocar-bench latency`: from the appointed time of a sample to the poll that brings its
//! snapshot, through real processes on cores of their own.
//!
//! Every round goes through all cases once, in an order drawn anew from the seed, so that whatever
//! else the machine does falls on all of them alike. Ratios to the floor are taken within a round;
//! the median of the rounds is reported.
//!
//! - [`case`]: what is measured together with what
//! - [`companion`]: programs that read the same channels
//! - [`schedule`]: the open-loop measurement of one slice
//! - [`link`]: the controller's end of each transport
//! - [`server`]: the answering processes
//! - [`sockets`], [`plain`], [`bytes`]: what they need
//! - `zeromq`: both ends of ZeroMQ, with the feature of that name
//! - [`costs`]: one poll, one publish
//! - [`rest`]: what a daemon takes while no sample comes
//! - [`report`], [`plot`]: the result
//! - [`command`]: the command line

pub mod bytes;
pub mod case;
pub mod command;
pub mod companion;
pub mod costs;
pub mod link;
pub mod plain;
pub mod plot;
pub mod report;
pub mod rest;
pub mod schedule;
pub mod server;
pub mod sockets;
#[cfg(feature = "zeromq")]
pub mod zeromq;

use crate::rig::cores::Cores;
use case::{Case, Outcome};
use costs::Costs;
use rest::AtRest;
use schedule::Schedule;

/// What was measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Each case with its outcome of every round.
    pub cases: Vec<(Case, Vec<Outcome>)>,
    /// What a call costs.
    pub costs: Costs,
    /// What a daemon takes while no sample comes.
    pub at_rest: Vec<AtRest>,
    /// How it was driven.
    pub schedule: Schedule,
    /// Where it ran.
    pub cores: Cores,
}
