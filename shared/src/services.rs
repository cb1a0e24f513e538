//! Names and versions of the channels, and the state by which a pipeline thread informs controllers that it sleeps.

use super::wire_struct;
use crate::sample::TrainId;

/// Schema version of the channels; peers of different majors use different services.
pub const SCHEMA_MAJOR: u32 = 1;

/// The iceoryx2 release whose shared-memory layout the channels use.
pub const TRANSPORT_VERSION: &str = "0.10.0";

/// Prefix of every shared-memory file. It belongs to this product and transport version alone, so that another iceoryx2
/// release never meets our segments.
pub const SEGMENT_PREFIX: &str = "dynocar_0_10_0_";

/// Samples a pipeline thread may fall behind before the oldest are overwritten.
pub const SAMPLE_BUFFER: usize = 512;

/// The most pipelines, over all daemons' configurations, that one train may have.
pub const PIPELINES_MAX: usize = 32;

/// Environment variable that moves all run-time files of Dynocar to another directory.
pub const ROOT_VARIABLE: &str = "DYNOCAR_ROOT";

/// The event service over which controllers wake sleeping pipeline threads; one for all trains,
/// with one listener for each thread.
pub const WAKE_SERVICE: &str = "dynocar/v1/wake";

/// The channels that belong to one train.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Samples, from the controller to every pipeline thread.
    Samples,
    /// Snapshots, from every pipeline to the controller.
    Snapshots,
    /// Shows the controller which pipeline threads sleep.
    Sleepers,
}

impl Channel {
    /// Returns the channel's part of the service name.
    pub const fn name(self) -> &'static str {
        match self {
            Channel::Samples => "samples",
            Channel::Snapshots => "snapshots",
            Channel::Sleepers => "sleepers",
        }
    }

    /// Writes the service name of this channel for a train: `dynocar/v1/train/7/samples`.
    ///
    /// # Errors
    ///
    /// When `out` is full.
    pub fn write_service_name(
        self,
        train: TrainId,
        out: &mut impl core::fmt::Write,
    ) -> core::fmt::Result {
        write!(out, "dynocar/v{SCHEMA_MAJOR}/train/{train}/{}", self.name())
    }
}

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
    /// Returns the listener's id in one number.
    pub const fn listener(&self) -> u128 {
        (self.listener_high as u128) << 64 | self.listener_low as u128
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn service_names_carry_schema_train_and_channel() {
        let mut name = String::new();
        Channel::Snapshots.write_service_name(TrainId(7), &mut name).unwrap();
        assert_eq!(name, "dynocar/v1/train/7/snapshots");
        assert!(WAKE_SERVICE.starts_with(&format!("dynocar/v{SCHEMA_MAJOR}/")));
    }
}
