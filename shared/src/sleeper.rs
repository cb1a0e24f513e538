//! How a pipeline thread informs a controller that it sleeps.

use crate::wire_struct;

wire_struct! {
    /// Whether one pipeline thread waits to be woken.
    ///
    /// A controller notifies the thread's listener only while the thread sleeps, so that it pays
    /// for a notification only then.
    pub struct SleeperState {
        /// Start of the daemon, see [`crate::ParameterSnapshot::epoch`].
        pub epoch: u64,
        /// Upper half of the thread's listener id.
        pub listener_high: u64,
        /// Lower half of the thread's listener id.
        pub listener_low: u64,
        /// 1 while the thread sleeps, 0 while it looks by itself.
        pub sleeping: u64,
    }
}

impl SleeperState {
    /// The listener's id in one number.
    pub const fn listener(&self) -> u128 {
        (self.listener_high as u128) << 64 | self.listener_low as u128
    }
}
