//! The threads of the daemon.
//!
//! - [`worker`]: a pipeline thread, from sample to snapshot
//! - [`exchange`]: pipelines of another model on their way to a thread, and the old ones back
//! - [`idle`]: what it does while no sample comes
//! - [`system`]: what it asks of the system: a core, a real-time priority, resident memory
//! - [`status_log`]: which changes of status and suspicion the log reports, which refused samples it names
//! - [`tally`]: what it reports to the main thread without waiting for it
//! - [`main_thread`]: what the main thread does meanwhile: signals, peers, the log

pub mod exchange;
pub mod idle;
pub mod main_thread;
pub mod status_log;
pub mod system;
pub mod tally;
pub mod worker;
