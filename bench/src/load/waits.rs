//! What kernel and machine take from a load while it runs.

use serde::Serialize;

use crate::rig::cores::Cores;
use crate::rig::usage;

/// What was taken from publishers and daemon, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Waits {
    /// The publishers' thread was ready but had no processor.
    pub publishers_s: f64,
    /// The daemon's fast thread was ready but had no processor.
    pub daemon_s: f64,
    /// The machine beneath took the two cores away, as far as it says so.
    pub stolen_s: f64,
}

impl Waits {
    /// Up to now, of the calling thread and of a thread of the daemon.
    pub fn so_far(process_id: u32, thread: &str, cores: Cores) -> Self {
        Waits {
            publishers_s: usage::own_wait_s(),
            daemon_s: usage::thread_wait_s(process_id, thread),
            stolen_s: usage::stolen_s(cores.controller) + usage::stolen_s(cores.server),
        }
    }

    /// What came since an earlier moment.
    pub fn since(self, earlier: Waits) -> Self {
        Waits {
            publishers_s: self.publishers_s - earlier.publishers_s,
            daemon_s: self.daemon_s - earlier.daemon_s,
            stolen_s: self.stolen_s - earlier.stolen_s,
        }
    }
}
