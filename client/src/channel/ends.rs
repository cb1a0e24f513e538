//! The two ends of each payload, written for each one, so that they are compiled in this crate.

use dynocar_shared::{ParameterSnapshot, SleeperState, TrainId, TrainSample};

use super::ports::{Receiver, Sender, open_receiver, open_sender};
use super::service::Entrance;
use super::wire::Payload;
use crate::error::ChannelError;

/// A payload whose channel has ends.
pub trait Ends: Payload {
    /// Opens a sending end.
    ///
    /// # Errors
    ///
    /// When the channel is of another layout or the shared memory cannot be used.
    fn sender(entrance: &Entrance, train: TrainId) -> Result<Sender<Self>, ChannelError>;

    /// Opens a receiving end.
    ///
    /// # Errors
    ///
    /// When the channel is of another layout or the shared memory cannot be used.
    fn receiver(entrance: &Entrance, train: TrainId) -> Result<Receiver<Self>, ChannelError>;
}

macro_rules! ends {
    ($($payload:ty),*) => {$(
        impl Ends for $payload {
            fn sender(entrance: &Entrance, train: TrainId) -> Result<Sender<Self>, ChannelError> {
                open_sender(entrance, train)
            }

            fn receiver(
                entrance: &Entrance,
                train: TrainId,
            ) -> Result<Receiver<Self>, ChannelError> {
                open_receiver(entrance, train)
            }
        }
    )*};
}

ends!(TrainSample, ParameterSnapshot, SleeperState);
