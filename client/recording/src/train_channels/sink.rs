//! Who takes what is read.

use dynocar_client::ChannelError;
use dynocar_shared::{ParameterSnapshot, TrainId, TrainSample};

use crate::event::Event;

/// Where that goes what is read: into a recording, to viewers.
pub trait Sink {
    /// Why nothing more is taken.
    type Error: From<ChannelError>;

    /// Takes a sample.
    ///
    /// # Errors
    ///
    /// When nothing more is taken; so for every other item.
    fn sample(&mut self, sample: &TrainSample) -> Result<(), Self::Error>;

    /// Takes a snapshot.
    ///
    /// # Errors
    ///
    /// As above.
    fn snapshot(&mut self, snapshot: &ParameterSnapshot) -> Result<(), Self::Error>;

    /// Takes an event.
    ///
    /// # Errors
    ///
    /// As above.
    fn event(&mut self, event: &Event) -> Result<(), Self::Error>;

    /// The channels of a train are open.
    ///
    /// # Errors
    ///
    /// As above.
    fn opened(&mut self, _train: TrainId) -> Result<(), Self::Error> {
        Ok(())
    }

    /// A daemon of this process has come; the event follows.
    ///
    /// # Errors
    ///
    /// As above.
    fn daemon_came(&mut self, _train: TrainId, _process: u32) -> Result<(), Self::Error> {
        Ok(())
    }
}
