//! The shared-memory ports: the only place that knows the transport.
//!
//! Publish-subscribe of iceoryx2 with safe overflow: a sender never waits, a slow receiver loses the oldest messages.
//! After the death of one side the other has to reopen nothing. Ports are not `Send`: open them in the thread that uses
//! them.

mod count;
pub(crate) mod process;
mod service;
mod transport;
mod users;
mod wake;

pub use count::SampleCount;
pub use process::Owner;
pub use service::{Payload, Wire};
pub use transport::{Ends, Receiver, Sender, Transport};
pub use wake::{Sleeper, Waker};
