//! The shared-memory ports: the only place that knows the transport.
//!
//! Publish-subscribe of iceoryx2 with safe overflow: a sender never waits, a slow receiver loses
//! the oldest. After the death of either side nothing has to be reopened by the other. Ports
//! are not `Send`: open them in the thread that uses them.

mod count;
mod ports;
mod service;
mod transport;
mod users;
mod wake;
mod wire;

pub use count::SampleCount;
pub use ports::{Ends, Receiver, Sender};
pub use transport::Transport;
pub use wake::{Sleeper, Waker};
pub use wire::{Payload, Wire};
