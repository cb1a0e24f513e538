//! The library that a train controller links: publish samples, poll parameter snapshots.
//!
//! ```no_run
//! use dynocar_client::{Host, SamplePublisher, SnapshotReader};
//! use dynocar_shared::{SampleField, TrainId, TrainSample};
//!
//! let host = Host::from_environment()?;
//! let train = TrainId(1);
//! let mut publisher = SamplePublisher::open(&host, train)?;
//! let mut reader = SnapshotReader::open(&host, train)?;
//! loop {
//!     let mut sample = TrainSample::empty(train).with(SampleField::Speed, 21.5);
//!     sample.time_ns = dynocar_client::monotonic_now_ns();
//!     publisher.publish(&mut sample)?;
//!     reader.poll();
//!     let now_ns = dynocar_client::monotonic_now_ns();
//!     if let Ok(reading) = reader.resistance(now_ns)
//!         && reading.is_usable()
//!         && let Some(resistance) = reading.snapshot.resistance_at(21.5)
//!     {
//!         println!("{} N/kN", resistance.w0_n_per_kn);
//!     }
//! #   break;
//! }
//! # Ok::<(), dynocar_client::ChannelError>(())
//! ```
//!
//! Neither call ever waits for the daemon: publishing overwrites the oldest sample when nobody reads, polling takes the
//! messages that are there. A daemon that died shows as age, and the next one is read without reopening anything.
//!
//! # Layout
//!
//! - [`publisher`], [`reader`]: the two ends that a controller holds
//! - [`ffi`]: the same for C and C++
//! - their common base is the package `dynocar-transport`

pub mod ffi;
pub mod publisher;
pub mod reader;

pub use dynocar_transport::channel::Owner;
pub use dynocar_transport::{
    Announcement, ChannelError, Host, Peer, Role, SendRefused, monotonic_now_ns,
};
pub use publisher::SamplePublisher;
pub use reader::{NoAnswer, Reading, SnapshotReader};
