//! The threads of the daemon.
//!
//! - [`worker`]: a pipeline thread, from sample to snapshot
//! - [`exchange`]: pipelines of another model on their way to a thread, and the old ones back
//! - [`idle`]: what it does while no sample comes
//! - [`affinity`]: binding it to a core
//! - [`scheduling`]: its real-time priority
//! - [`memory`]: keeping its memory resident
//! - [`status_log`]: which changes of status and suspicion the log reports
//! - [`refusal_log`]: which refused samples it names
//! - [`tally`]: what it reports to the main thread without waiting for it
//! - [`watch`]: what the main thread does meanwhile: signals, peers, the log

pub mod affinity;
pub mod exchange;
pub mod idle;
pub mod memory;
pub mod refusal_log;
pub mod scheduling;
pub mod status_log;
pub mod tally;
pub mod watch;
pub mod worker;
