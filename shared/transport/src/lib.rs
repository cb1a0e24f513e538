//! The channels that the daemon and a controller's library both use.
//!
//! # Layout
//!
//! - [`host`]: where the run-time files of this host lie, and its monotonic clock
//! - [`peer`]: who serves and who drives a train, and whether we understand each other
//! - [`channel`]: the shared-memory ports

mod announcement;
pub mod channel;
pub mod error;
pub mod host;
pub mod peer;

pub use announcement::{Announcement, Role};
pub use error::{ChannelError, SendRefused};
pub use host::{Host, monotonic_now_ns};
pub use peer::Peer;
