//! The threads of the daemon.
//!
//! - [`worker`]: a pipeline thread, from sample to snapshot; idle strategies while no sample comes
//! - [`exchange`]: pipelines of another model on their way to a thread, and the old ones on their way back
//! - [`system`]: the requests of a thread to the system: a core, a real-time priority, resident memory
//! - [`tally`]: signs of life, counts and details for the log, for which neither a pipeline thread nor the main thread waits
//! - [`main_thread`]: the work of the main thread: signals, peers, the log

pub mod exchange;
pub mod main_thread;
pub mod system;
pub mod tally;
pub mod worker;
