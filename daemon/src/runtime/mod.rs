//! The threads of the daemon.
//!
//! - [`worker`]: a pipeline thread, from sample to snapshot
//! - [`exchange`]: pipelines of another model on their way to a thread, and the old ones back
//! - [`idle`]: idle strategies while no sample comes
//! - [`system`]: its requests to the system: a core, a real-time priority, resident memory
//! - [`status_log`]: which changes of status and suspicion the log reports, which refused samples it names
//! - [`tally`]: its reports to the main thread, for which neither waits
//! - [`main_thread`]: the work of the main thread: signals, peers, the log

pub mod exchange;
pub mod idle;
pub mod main_thread;
pub mod status_log;
pub mod system;
pub mod tally;
pub mod worker;
