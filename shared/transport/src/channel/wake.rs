//! Waking a pipeline thread that sleeps, and paying for it only then.
//!
//! The thread announces on the sleepers channel that it is about to sleep, checks once more for samples, and waits on
//! its listener. The controller sends a sample, then reads the sleepers channel, and notifies only threads that sleep.
//! A full fence on both sides between writing and reading makes sure that at least one of the two sees the other. A
//! controller that has just started knows of no thread yet and wakes every thread for a while. Should a notification be
//! lost all the same, the wait ends by its timeout.

use std::sync::atomic::{Ordering, fence};
use std::time::Duration;

use dynocar_shared::services::WAKE_SERVICE;
use dynocar_shared::{SleeperState, TrainId};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{CallbackProgression, ServiceName, ipc};
use iceoryx2::service::port_factory::event::PortFactory;

use super::service::Held;
use super::{Receiver, Sender, Transport};
use crate::error::ChannelError;
use crate::host::monotonic_now_ns;

/// Pipeline threads that one controller can keep track of.
const SLEEPERS_MAX: usize = 32;
/// Time in ns for which a new controller wakes threads that have not announced themselves yet; each thread announces
/// itself more often than that.
const NEWCOMER_NS: i64 = 500_000_000;
const LISTENERS_MAX: usize = 64;
const NOTIFIERS_MAX: usize = 256;

fn wake_service(transport: &Transport) -> Result<PortFactory<ipc::Service>, ChannelError> {
    let refused =
        |reason: String| ChannelError::transport(format!("service {WAKE_SERVICE}"), reason);
    let name = ServiceName::new(WAKE_SERVICE).map_err(|error| refused(format!("{error:?}")))?;
    let _making = transport.users().begin_making(false)?;
    transport
        .node()
        .service_builder(&name)
        .event()
        .max_listeners(LISTENERS_MAX)
        .max_notifiers(NOTIFIERS_MAX)
        .max_nodes(LISTENERS_MAX + NOTIFIERS_MAX)
        .open_or_create()
        .map_err(|error| refused(format!("{error:?}")))
}

/// A pipeline thread's bed: informs the controllers of its trains, then waits for one of them.
#[derive(Debug)]
pub struct Sleeper {
    listener: Held<Listener<ipc::Service>>,
    senders: Vec<Sender<SleeperState>>,
    state: SleeperState,
}

impl Sleeper {
    /// Returns a bed for the thread that serves these trains in the daemon of this epoch.
    ///
    /// # Errors
    ///
    /// When the transport refuses a port.
    pub fn open(
        transport: &Transport,
        trains: &[TrainId],
        epoch: u64,
    ) -> Result<Self, ChannelError> {
        let listener = wake_service(transport)?
            .listener_builder()
            .create()
            .map_err(|error| ChannelError::transport("listener".into(), format!("{error:?}")))?;
        let senders = trains
            .iter()
            .map(|&train| transport.sender::<SleeperState>(train))
            .collect::<Result<_, _>>()?;
        let id = listener.id().value();
        let state = SleeperState {
            epoch,
            listener_high: (id >> 64) as u64,
            listener_low: id as u64,
            sleeping: 0,
        };
        Ok(Sleeper { listener: Held::new(listener), senders, state })
    }

    /// Waits until a controller sends or `timeout` has passed, unless `has_work` after the
    /// controllers were informed.
    pub fn sleep(&mut self, timeout: Duration, has_work: impl FnOnce() -> bool) {
        self.announce(1);
        fence(Ordering::SeqCst);
        if !has_work() {
            // A failed wait is a short one: the caller looks for samples and comes back.
            let _ = self.listener.get().timed_wait(|_| {}, timeout);
        }
        self.announce(0);
    }

    /// Speaks up to controllers that have come since; for a thread that seldom sleeps.
    pub fn serve_newcomers(&self) {
        self.senders.iter().for_each(Sender::serve_newcomers);
    }

    fn announce(&mut self, sleeping: u64) {
        self.state.sleeping = sleeping;
        for sender in &self.senders {
            // An untold controller does not notify: the wait ends by its timeout.
            let _ = sender.send(&self.state);
        }
    }
}

/// A controller's account of who sleeps.
#[derive(Debug)]
pub struct Waker {
    notifier: Held<Notifier<ipc::Service>>,
    receiver: Receiver<SleeperState>,
    known: [Option<SleeperState>; SLEEPERS_MAX],
    newcomer_until_ns: i64,
}

impl Waker {
    /// Returns an account for a train.
    ///
    /// # Errors
    ///
    /// When the transport refuses a port.
    pub fn open(transport: &Transport, train: TrainId) -> Result<Self, ChannelError> {
        let notifier = wake_service(transport)?
            .notifier_builder()
            .create()
            .map_err(|error| ChannelError::transport("notifier".into(), format!("{error:?}")))?;
        let receiver = transport.receiver::<SleeperState>(train)?;
        let newcomer_until_ns = monotonic_now_ns() + NEWCOMER_NS;
        let known = [None; SLEEPERS_MAX];
        Ok(Waker { notifier: Held::new(notifier), receiver, known, newcomer_until_ns })
    }

    /// Wakes who sleeps; to be called after each sample, with the host's monotonic time.
    ///
    /// # Real-time
    ///
    /// Without a sleeper: no system call, no allocation. With one: one notification each.
    pub fn wake(&mut self, now_ns: i64) {
        fence(Ordering::SeqCst);
        while let Some(state) = self.receiver.receive() {
            self.note(state);
        }
        let is_newcomer = now_ns < self.newcomer_until_ns;
        if is_newcomer || self.known.iter().flatten().any(|state| state.sleeping != 0) {
            self.notify_sleepers(is_newcomer);
        }
    }

    /// Keeps the newest word of each thread, in place of one of an older daemon when full.
    fn note(&mut self, state: SleeperState) {
        let same = |entry: &Option<SleeperState>| {
            entry.is_some_and(|known| known.listener() == state.listener())
        };
        let older =
            |entry: &Option<SleeperState>| entry.is_none_or(|known| known.epoch < state.epoch);
        let index = self.known.iter().position(same).or(self.known.iter().position(older));
        if let Some(index) = index {
            self.known[index] = Some(state);
        }
    }

    fn notify_sleepers(&mut self, wake_strangers: bool) {
        let known = &self.known;
        self.notifier.get().for_each_listener(|listener, details| {
            let id = details.listener_id.value();
            let state = known.iter().flatten().find(|state| state.listener() == id);
            if state.map_or(wake_strangers, |state| state.sleeping != 0) {
                // A dead thread cannot be woken, and need not be.
                let _ = listener.notify();
            }
            CallbackProgression::Continue
        });
        // Once woken, or gone for good, a sleeper speaks up before it sleeps again.
        for state in self.known.iter_mut().flatten() {
            state.sleeping = 0;
        }
    }
}
