//! Sending and receiving ends.

use std::sync::Arc;

use dynocar_shared::TrainId;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{BackpressureStrategy, ipc};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::no_place_left;
use super::users::Users;
use super::wire::{Payload, Wire};
use crate::error::{ChannelError, SendRefused};

type Service<T> = PortFactory<ipc::Service, Wire<T>, ()>;

fn refused<T: Payload>(train: TrainId, port: &str, reason: impl std::fmt::Debug) -> ChannelError {
    let channel = T::CHANNEL.name();
    ChannelError::Transport {
        what: format!("{port} of train {train}'s {channel}"),
        reason: format!("{reason:?}"),
    }
}

/// The sending end of a channel.
#[derive(Debug)]
pub struct Sender<T: Payload> {
    publisher: Publisher<ipc::Service, Wire<T>, ()>,
    _users: Arc<Users>,
}

impl<T: Payload> Sender<T> {
    pub(super) fn new(
        service: &Service<T>,
        train: TrainId,
        users: &Arc<Users>,
    ) -> Result<Self, ChannelError> {
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
        Ok(Sender { publisher, _users: Arc::clone(users) })
    }

    /// Sends a message to every receiver; never waits.
    ///
    /// # Errors
    ///
    /// When the transport refuses, for instance because the shared memory is full.
    ///
    /// # Real-time
    ///
    /// No system call, save when a receiver has come or gone since. The transport takes one
    /// reference count of fixed size from the heap and gives it back within the call.
    pub fn send(&self, message: &T) -> Result<(), SendRefused> {
        let slot = self.publisher.loan_uninit().map_err(|_| SendRefused)?;
        slot.write_payload(Wire(*message)).send().map(|_| ()).map_err(|_| SendRefused)
    }

    /// Hands the history to receivers that have come since the last message.
    pub fn serve_newcomers(&self) {
        // A newcomer that cannot be connected is tried again with the next message.
        let _ = self.publisher.update_connections();
    }
}

/// The receiving end of a channel.
#[derive(Debug)]
pub struct Receiver<T: Payload> {
    subscriber: Subscriber<ipc::Service, Wire<T>, ()>,
    _users: Arc<Users>,
}

impl<T: Payload> Receiver<T> {
    pub(super) fn new(
        service: &Service<T>,
        train: TrainId,
        users: &Arc<Users>,
    ) -> Result<Self, ChannelError> {
        let subscriber =
            service.subscriber_builder().buffer_size(T::BUFFER).create().map_err(|error| {
                match error {
                    SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
                        no_place_left::<T>(train, T::RECEIVERS_MAX)
                    }
                    error => refused::<T>(train, "receiver", error),
                }
            })?;
        Ok(Receiver { subscriber, _users: Arc::clone(users) })
    }

    /// Takes the next message, copied out of the shared memory; `None` when there is none.
    ///
    /// A sender that cannot be connected counts as silent.
    ///
    /// # Real-time
    ///
    /// No system call and no allocation, save when a sender has come or gone since.
    pub fn receive(&self) -> Option<T> {
        self.subscriber.receive().ok().flatten().map(|message| message.payload().0)
    }
}
