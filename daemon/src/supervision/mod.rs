//! Supervision of a daemon: its life, its health, its numbers.
//!
//! - [`notify`]: readiness and watchdog by the protocol of `sd_notify`
//! - [`health`]: one verdict on a train's daemon, from outside
//! - [`metrics`]: the numbers as OpenMetrics text
//! - [`listener`]: the loopback listener that serves this text

pub mod health;
pub mod listener;
pub mod metrics;
pub mod notify;
