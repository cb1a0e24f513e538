//! A thread's access to the transport, and its sending and receiving ends: the transport's ports behind trait objects.
//! They are instantiated here for each payload,
//! so that the generic code is compiled in this crate.

use std::fmt::Debug;
use std::sync::Arc;

use dynocar_shared::{ParameterSnapshot, SleeperState, TrainId, TrainSample};
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{
    BackpressureStrategy, Node, NodeBuilder, NodeName, SignalHandlingMode, ipc,
    set_log_level_from_env_or,
};

use super::process::Owned;
use super::service::{Entrance, Held, Payload, Wire, no_place_left};
use super::users::Users;
use crate::error::{ChannelError, SendRefused};
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
        let making = users.begin_making(false)?;
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

/// Interface of a sender to its port.
trait Send<T>: Debug {
    fn send(&self, message: &T) -> Result<(), SendRefused>;
    fn serve_newcomers(&self);
}

impl<T: Payload> Send<T> for Publisher<ipc::Service, Wire<T>, ()> {
    fn send(&self, message: &T) -> Result<(), SendRefused> {
        let slot = self.loan_uninit().map_err(|_| SendRefused)?;
        slot.write_payload(Wire(*message)).send().map(|_| ()).map_err(|_| SendRefused)
    }

    fn serve_newcomers(&self) {
        // A newcomer that cannot be connected is tried again with the next message.
        let _ = self.update_connections();
    }
}

/// Interface of a receiver to its port.
trait Receive<T>: Debug {
    fn next(&self) -> Option<T>;
}

impl<T: Payload> Receive<T> for Subscriber<ipc::Service, Wire<T>, ()> {
    fn next(&self) -> Option<T> {
        self.receive().ok().flatten().map(|message| message.payload().0)
    }
}

fn refused<T: Payload>(train: TrainId, port: &str, reason: impl Debug) -> ChannelError {
    let channel = T::CHANNEL.name();
    let what = format!("{port} of train {train}'s {channel}");
    ChannelError::transport(what, format!("{reason:?}"))
}

/// The sending end of a channel.
#[derive(Debug)]
pub struct Sender<T: Payload> {
    port: Owned<Box<dyn Send<T>>>,
    _users: Arc<Users>,
}

/// Opens a sending end; called for each payload in this crate alone.
pub(super) fn open_sender<T: Payload>(
    entrance: &Entrance,
    train: TrainId,
) -> Result<Sender<T>, ChannelError> {
    let (service, _making) = entrance.service::<T>(train)?;
    let publisher = service
        .publisher_builder()
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|error| match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers => {
                no_place_left::<T>(train, T::SENDERS_MAX)
            }
            error => refused::<T>(train, "sender", error),
        })?;
    Ok(Sender { port: Owned::new(Box::new(publisher)), _users: Arc::clone(&entrance.users) })
}

impl<T: Payload> Sender<T> {
    /// Sends a message to every receiver; never waits.
    ///
    /// # Errors
    ///
    /// When the transport refuses, for instance because the shared memory is full; in a child that was
    /// forked since.
    ///
    /// # Real-time
    ///
    /// No system call, save when a receiver has come or gone since. The transport takes one
    /// reference count of fixed size from the heap and gives it back within the call.
    pub fn send(&self, message: &T) -> Result<(), SendRefused> {
        self.port.own().ok_or(SendRefused)?.send(message)
    }

    /// Hands the history to receivers that have come since the last message.
    pub fn serve_newcomers(&self) {
        if let Some(port) = self.port.own() {
            port.serve_newcomers();
        }
    }
}

/// The receiving end of a channel.
#[derive(Debug)]
pub struct Receiver<T: Payload> {
    port: Owned<Box<dyn Receive<T>>>,
    _users: Arc<Users>,
}

/// Opens a receiving end; called for each payload in this crate alone.
pub(super) fn open_receiver<T: Payload>(
    entrance: &Entrance,
    train: TrainId,
) -> Result<Receiver<T>, ChannelError> {
    let (service, _making) = entrance.service::<T>(train)?;
    let subscriber = service.subscriber_builder().buffer_size(T::BUFFER).create().map_err(
        |error| match error {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
                no_place_left::<T>(train, T::RECEIVERS_MAX)
            }
            error => refused::<T>(train, "receiver", error),
        },
    )?;
    Ok(Receiver { port: Owned::new(Box::new(subscriber)), _users: Arc::clone(&entrance.users) })
}

impl<T: Payload> Receiver<T> {
    /// Takes the next message, copied out of the shared memory; `None` when there is none.
    ///
    /// A sender that cannot be connected counts as silent; in a child that was forked since, all are.
    ///
    /// # Real-time
    ///
    /// No system call and no allocation, save when a sender has come or gone since.
    pub fn receive(&self) -> Option<T> {
        self.port.own()?.next()
    }
}

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
