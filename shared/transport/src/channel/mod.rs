//! The shared-memory ports: the only place that knows the transport.
//!
//! Publish-subscribe of iceoryx2 with safe overflow: a sender never waits, a slow receiver loses the oldest messages.
//! After the death of one side the other has to reopen nothing. Ports are not `Send`: open them in the thread that uses
//! them.

mod count;
mod ports;
pub(crate) mod process;
mod service;
mod transport;
mod users;
mod wake;
mod wire;

pub use count::SampleCount;
pub use ports::{Ends, Receiver, Sender};
pub use process::Owner;
pub use transport::Transport;
pub use wake::{Sleeper, Waker};
pub use wire::{Payload, Wire};
