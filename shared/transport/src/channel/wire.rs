//! The types that cross the shared memory, in the form that the transport requires.

use std::fmt::Debug;

use dynocar_shared::services::{Channel, PIPELINES_MAX, SAMPLE_BUFFER};
use dynocar_shared::{ParameterSnapshot, SleeperState, TrainSample};
use iceoryx2::prelude::ZeroCopySend;

/// A payload under its wire name, which carries the layout hash.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Wire<T>(pub T);

mod sealed {
    pub trait Sealed {}
    impl Sealed for dynocar_shared::TrainSample {}
    impl Sealed for dynocar_shared::ParameterSnapshot {}
    impl Sealed for dynocar_shared::SleeperState {}
}

/// A type with a channel of its own.
pub trait Payload: sealed::Sealed + Copy + Debug + 'static {
    /// The channel.
    const CHANNEL: Channel;
    /// The type's name on the channel.
    const WIRE_NAME: &'static str;
    /// Messages a receiver holds before the oldest is overwritten.
    const BUFFER: usize;
    /// Messages a sender keeps for receivers that come later.
    const HISTORY: usize;
    /// The most senders of one train's channel.
    const SENDERS_MAX: usize;
    /// The most receivers of one train's channel.
    const RECEIVERS_MAX: usize;
}

impl Payload for TrainSample {
    const CHANNEL: Channel = Channel::Samples;
    const WIRE_NAME: &'static str = TrainSample::WIRE_NAME;
    const BUFFER: usize = SAMPLE_BUFFER;
    const HISTORY: usize = 0;
    /// The controller, and a dead one that is not cleared away yet.
    const SENDERS_MAX: usize = 4;
    /// Pipeline threads, recorder, live view.
    const RECEIVERS_MAX: usize = 12;
}

impl Payload for ParameterSnapshot {
    const CHANNEL: Channel = Channel::Snapshots;
    const WIRE_NAME: &'static str = ParameterSnapshot::WIRE_NAME;
    const BUFFER: usize = 1;
    const HISTORY: usize = 1;
    /// Each pipeline has a sender of its own; twice, for a dead daemon not cleared away yet.
    const SENDERS_MAX: usize = 2 * PIPELINES_MAX;
    const RECEIVERS_MAX: usize = 12;
}

impl Payload for SleeperState {
    const CHANNEL: Channel = Channel::Sleepers;
    const WIRE_NAME: &'static str = SleeperState::WIRE_NAME;
    const BUFFER: usize = 1;
    const HISTORY: usize = 1;
    const SENDERS_MAX: usize = PIPELINES_MAX;
    const RECEIVERS_MAX: usize = 12;
}

// SAFETY: a payload is a `repr(C)` struct of plain numbers without padding (checked when it is
// compiled), holds no pointer, index or handle, and its name carries a hash of its whole layout.
unsafe impl<T: Payload> ZeroCopySend for Wire<T> {
    unsafe fn type_name() -> &'static str {
        T::WIRE_NAME
    }
}
