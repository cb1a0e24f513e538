//! A thread's access to the transport.

use std::sync::Arc;

use dynocar_shared::TrainId;
use iceoryx2::prelude::{
    Node, NodeBuilder, NodeName, SignalHandlingMode, ipc, set_log_level_from_env_or,
};

use super::ports::{Ends, Receiver, Sender};
use super::service::{Entrance, Held};
use super::users::Users;
use crate::error::ChannelError;
use crate::host::Host;

/// This thread's access to the transport.
#[derive(Debug)]
pub struct Transport {
    entrance: Entrance,
}

impl Transport {
    /// Enters the transport under a name for diagnosis.
    ///
    /// Leaves the process's signal handlers alone, and removes the files of dead processes.
    ///
    /// # Errors
    ///
    /// When the run-time directory or the shared memory cannot be used.
    pub fn open(host: &Host, name: &str) -> Result<Self, ChannelError> {
        set_log_level_from_env_or(iceoryx2::prelude::LogLevel::Fatal);
        let refused = |reason: String| ChannelError::transport("node".into(), reason);
        let users = Users::enter(host)?;
        users.require_free_memory()?;
        let name = NodeName::new(name).map_err(|error| refused(format!("{error:?}")))?;
        let making = users.begin_making()?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&host.transport_config()?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| refused(format!("{error:?}")))?;
        users.close_to_others();
        drop(making);
        let entrance = Entrance { node: Held::new(node), users: Arc::new(users) };
        Ok(Transport { entrance })
    }

    /// Opens a sending port of a train's channel.
    ///
    /// # Errors
    ///
    /// When the channel is of another layout or the shared memory cannot be used.
    pub fn sender<T: Ends>(&self, train: TrainId) -> Result<Sender<T>, ChannelError> {
        T::sender(&self.entrance, train)
    }

    /// Opens a receiving port of a train's channel.
    ///
    /// # Errors
    ///
    /// When the channel is of another layout or the shared memory cannot be used.
    pub fn receiver<T: Ends>(&self, train: TrainId) -> Result<Receiver<T>, ChannelError> {
        T::receiver(&self.entrance, train)
    }

    /// Reserves the memory of all ports opened so far; to be called once all are.
    ///
    /// # Errors
    ///
    /// When there is not enough.
    pub fn reserve(&self) -> Result<(), ChannelError> {
        self.entrance.users.reserve()
    }

    pub(super) fn users(&self) -> &Users {
        &self.entrance.users
    }

    pub(super) fn node(&self) -> &Node<ipc::Service> {
        self.entrance.node.get()
    }
}
