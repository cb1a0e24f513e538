//! The C interface: the functions that C and C++ controllers link, declared in `include/dynocar.h`.
//!
//! Thin on purpose: each function checks its pointers, calls the Rust end that a Rust controller
//! uses, and gives a [`Code`]. No panic crosses the boundary ([`error`]), and a handle used by
//! another thread than the one that opened it is refused ([`handle`]).
//!
//! # Layout
//!
//! - [`error`]: codes, messages, and the barrier that panics do not pass
//! - [`handle`]: the target of a `dynocar_publisher *` or a `dynocar_reader *`
//! - [`publisher`], [`reader`]: the two ends a controller holds
//! - [`snapshot`]: resistance, parameters and covariances from a copied snapshot
//! - [`stopping`]: braking distance and time with a bound
//! - [`about`]: clock, versions, who serves a train, and the vocabularies' names
//!
//! # Safety
//!
//! All functions here have these conditions and no others:
//!
//! - a pointer is NULL or points to a readable (`const`) or writable object of its type, aligned,
//!   that nobody else touches during the call;
//! - a `message` is NULL or points to `message_size` writable bytes;
//! - a root is NULL or ends with a NUL byte;
//! - a handle comes from this library's `open` and has not been closed.

pub mod about;
pub mod error;
pub mod handle;
pub mod publisher;
pub mod reader;
pub mod snapshot;
pub mod stopping;

pub use error::Code;
pub use reader::ReadingCopy;
pub use snapshot::ResistanceAtSpeed;
pub use stopping::{EffortPlace, Rail, StopRequest, Stopping};
