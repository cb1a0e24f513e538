//! The channels that the daemon and a controller's library both stand on.
//!
//! # Layout
//!
//! - [`host`]: where the run-time files of this host lie
//! - [`peer`]: who serves and who drives a train, and whether we understand each other
//! - [`channel`]: the shared-memory ports
//! - [`clock`]: the host's monotonic clock

mod announcement;
pub mod channel;
pub mod clock;
pub mod error;
pub mod host;
pub mod peer;

pub use announcement::{Announcement, Role};
pub use clock::monotonic_now_ns;
pub use error::{ChannelError, SendRefused};
pub use host::Host;
pub use peer::Peer;
