//! Who takes what is read.

use dynocar_client::ChannelError;
use dynocar_shared::TrainId;

use crate::topic::Message;

/// Where that goes what is read: into a recording, to viewers.
pub trait Sink {
    /// Why nothing more is taken.
    type Error: From<ChannelError>;

    /// Takes a message.
    ///
    /// # Errors
    ///
    /// When nothing more is taken; so for all else.
    fn take(&mut self, message: Message<'_>) -> Result<(), Self::Error>;

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
