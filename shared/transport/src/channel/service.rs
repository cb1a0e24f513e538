//! Entering the transport, the services of its channels, and its ports behind trait objects.
//!
//! This way the transport's generic code, some thousand functions, is compiled once, in this crate, and not in every
//! crate that opens or drops a port.
//!
//! Here are also the types that cross the shared memory, in the form that the transport requires.

use std::fmt::Debug;
use std::sync::Arc;
use std::time::{Duration, Instant};

use dynocar_shared::services::{Channel, PIPELINES_MAX, SAMPLE_BUFFER};
use dynocar_shared::{ParameterSnapshot, SleeperState, TrainId, TrainSample};
use iceoryx2::node::{NodeState, NodeView};
use iceoryx2::prelude::{MessagingPattern, Node, Service, ServiceName, ZeroCopySend, ipc};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::process::Owned;
use super::users::{Making, Users};
use crate::error::ChannelError;

/// Longest wait for a service that another process is making or destroying.
const SETTLING_TIME: Duration = Duration::from_millis(800);

/// The service of a channel.
type ChannelService<T> = PortFactory<ipc::Service, Wire<T>, ()>;

/// This thread's place in the transport.
#[derive(Debug)]
pub struct Entrance {
    pub(super) node: Held<Node<ipc::Service>>,
    /// After the node: the last user goes only when its ports are gone.
    pub(super) users: Arc<Users>,
}

impl Entrance {
    /// Opens or makes the service of a train's channel, and lets nobody else make anything until the lock is dropped:
    /// hold it while making a port. A port connects itself to all others before they see it, so that none of them, in
    /// the midst of a control cycle, makes a connection or waits for one.
    pub(super) fn service<T: Payload>(
        &self,
        train: TrainId,
    ) -> Result<(ChannelService<T>, Making), ChannelError> {
        let text = service_name::<T>(train);
        let refused = |reason: String| ChannelError::transport(format!("service {text}"), reason);
        let name = ServiceName::new(&text).map_err(|error| refused(format!("{error:?}")))?;
        let start = Instant::now();
        let mut is_refused = false;
        loop {
            let making = self.users.begin_making(is_refused)?;
            let result = self
                .node
                .get()
                .service_builder(&name)
                .publish_subscribe::<Wire<T>>()
                .enable_safe_overflow(true)
                .history_size(T::HISTORY)
                .subscriber_max_buffer_size(T::BUFFER)
                .subscriber_max_borrowed_samples(1)
                .max_publishers(T::SENDERS_MAX)
                .max_subscribers(T::RECEIVERS_MAX)
                .max_nodes(T::SENDERS_MAX + T::RECEIVERS_MAX)
                .open_or_create();
            match result {
                Ok(service) => return Ok((service, making)),
                Err(error) if is_settling(&error) && start.elapsed() < SETTLING_TIME => {
                    drop(making);
                    is_refused = true;
                    std::thread::sleep(Duration::from_millis(2));
                }
                Err(PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(
                    PublishSubscribeOpenError::ExceedsMaxNumberOfNodes,
                )) => return Err(no_place_left::<T>(train, T::SENDERS_MAX + T::RECEIVERS_MAX)),
                Err(error) if is_of_a_stranger(&error) => {
                    let users = self.strangers_of(&name);
                    return Err(ChannelError::Stranger { service: text, users });
                }
                Err(error) => return Err(refused(explain(&error))),
            }
        }
    }

    /// Returns the processes that use a service, by their programs.
    fn strangers_of(&self, name: &ServiceName) -> String {
        let pattern = MessagingPattern::PublishSubscribe;
        let details = ipc::Service::details(name, self.node.get().config(), pattern);
        let dynamic = details.ok().flatten().and_then(|it| it.dynamic_details);
        let nodes = dynamic.map(|it| it.nodes).unwrap_or_default();
        let known = nodes.iter().filter_map(|node| match node {
            NodeState::Alive(view) => view.details().as_ref(),
            _ => None,
        });
        let users: Vec<String> = known
            .map(|it| format!("{} (process {})", it.executable(), it.process_id().value()))
            .collect();
        if users.is_empty() { "a process that is gone".into() } else { users.join(", ") }
    }
}

/// Returns whether the service was made with other settings than ours.
fn is_of_a_stranger(error: &PublishSubscribeOpenOrCreateError) -> bool {
    use PublishSubscribeOpenError as Open;
    let PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(error) = error else {
        return false;
    };
    matches!(
        error,
        Open::IncompatibleMessagingPattern
            | Open::IncompatibleAttributes
            | Open::DoesNotSupportRequestedMinBufferSize
            | Open::DoesNotSupportRequestedMinHistorySize
            | Open::DoesNotSupportRequestedMinSubscriberBorrowedSamples
            | Open::DoesNotSupportRequestedAmountOfPublishers
            | Open::DoesNotSupportRequestedAmountOfSubscribers
            | Open::DoesNotSupportRequestedAmountOfNodes
            | Open::IncompatibleOverflowBehavior
    )
}

/// Returns the refusal where every place of a channel is taken.
pub(super) fn no_place_left<T: Payload>(train: TrainId, limit: usize) -> ChannelError {
    ChannelError::NoPlaceLeft { train, channel: T::CHANNEL.name(), limit }
}

fn service_name<T: Payload>(train: TrainId) -> String {
    let mut name = String::new();
    // Writing into a String cannot fail.
    let _ = T::CHANNEL.write_service_name(train, &mut name);
    name
}

/// Returns true for an error that passes by itself while another process makes or removes the service.
fn is_settling(error: &PublishSubscribeOpenOrCreateError) -> bool {
    use PublishSubscribeOpenOrCreateError as Error;
    match error {
        Error::PublishSubscribeOpenError(error) => matches!(
            error,
            PublishSubscribeOpenError::IsMarkedForDestruction
                | PublishSubscribeOpenError::HangsInCreation
                | PublishSubscribeOpenError::DoesNotExist
                | PublishSubscribeOpenError::ServiceInCorruptedState
        ),
        Error::PublishSubscribeCreateError(error) => matches!(
            error,
            PublishSubscribeCreateError::AlreadyExists
                | PublishSubscribeCreateError::IsBeingCreatedByAnotherInstance
                | PublishSubscribeCreateError::HangsInCreation
                | PublishSubscribeCreateError::ServiceInCorruptedState
        ),
        Error::SystemInFlux => true,
    }
}

/// Returns the transport's refusal with the remedy for the user, where we know one.
fn explain(error: &PublishSubscribeOpenOrCreateError) -> String {
    use PublishSubscribeOpenError as Open;
    use PublishSubscribeOpenOrCreateError as Error;
    let hint = match error {
        Error::PublishSubscribeOpenError(Open::IncompatibleTypes) => {
            "; a process of another Dynocar release uses this channel: stop it, or update"
        }
        Error::PublishSubscribeOpenError(Open::ServiceInCorruptedState) => {
            "; files in the run-time directory or /dev/shm were removed or overwritten: stop every \
             process of this channel and start again"
        }
        _ => "",
    };
    format!("{error:?}{hint}")
}

/// Something of the transport's that is dropped by code of this crate.
#[derive(Debug)]
pub(super) struct Held<P>(Owned<Box<dyn Hold<P>>>);

trait Hold<P>: Debug {
    fn held(&self) -> &P;
}

#[derive(Debug)]
struct Holder<P>(P);

impl<P: Debug> Hold<P> for Holder<P> {
    fn held(&self) -> &P {
        &self.0
    }
}

impl<P: Debug + 'static> Held<P> {
    pub(super) fn new(held: P) -> Self {
        Held(Owned::new(Box::new(Holder(held))))
    }

    pub(super) fn get(&self) -> &P {
        self.0.held()
    }
}

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
    const BUFFER: usize = 1;
    /// Messages a sender keeps for receivers that come later.
    const HISTORY: usize = 1;
    /// The most senders of one train's channel.
    const SENDERS_MAX: usize;
    /// The most receivers of one train's channel: pipeline threads, recorder, live view.
    const RECEIVERS_MAX: usize = 12;
}

impl Payload for TrainSample {
    const CHANNEL: Channel = Channel::Samples;
    const WIRE_NAME: &'static str = TrainSample::WIRE_NAME;
    const BUFFER: usize = SAMPLE_BUFFER;
    const HISTORY: usize = 0;
    /// The controller, and a dead one that is not cleared away yet.
    const SENDERS_MAX: usize = 4;
}

impl Payload for ParameterSnapshot {
    const CHANNEL: Channel = Channel::Snapshots;
    const WIRE_NAME: &'static str = ParameterSnapshot::WIRE_NAME;
    /// Each pipeline has a sender of its own; twice, for a dead daemon not cleared away yet.
    const SENDERS_MAX: usize = 2 * PIPELINES_MAX;
}

impl Payload for SleeperState {
    const CHANNEL: Channel = Channel::Sleepers;
    const WIRE_NAME: &'static str = SleeperState::WIRE_NAME;
    const SENDERS_MAX: usize = PIPELINES_MAX;
}

// SAFETY: a payload is a `repr(C)` struct of plain numbers without padding (checked when it is
// compiled), holds no pointer, index or handle, and its name carries a hash of its whole layout.
unsafe impl<T: Payload> ZeroCopySend for Wire<T> {
    unsafe fn type_name() -> &'static str {
        T::WIRE_NAME
    }
}
