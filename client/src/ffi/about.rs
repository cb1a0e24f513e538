//! Clock, versions, and who serves a train.

use std::ffi::{CStr, OsStr, c_char};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use dynocar_shared::{ParameterSnapshot, SCHEMA_MAJOR, TrainId, TrainSample, vocabulary};

use super::error::{Code, Failure, Message, guard_in_words};
use crate::announcement::Role;
use crate::error::ChannelError;
use crate::host::Host;
use crate::peer::Peer;

vocabulary! {
    /// Who serves a train; `DYNOCAR_DAEMON_…` in C.
    DaemonState: i32 {
        /// Nobody serves the train.
        Absent = 0 "absent",
        /// A living daemon serves it.
        Compatible = 1 "compatible",
        /// A living daemon serves it, and we cannot understand each other.
        Incompatible = 2 "incompatible",
    }
}

/// Who serves a train now, as a state and in words. Opens files: not for the control cycle.
///
/// # Errors
///
/// When the announcement cannot be read.
pub fn state_of_daemon(host: &Host, train: TrainId) -> Result<(DaemonState, String), ChannelError> {
    let peer = Peer::look_up(host, train, Role::Daemon)?;
    Ok(match &peer {
        Peer::Absent => (DaemonState::Absent, format!("no daemon serves train {train}")),
        Peer::Compatible(daemon) => (DaemonState::Compatible, daemon.to_string()),
        Peer::Incompatible(_) => {
            let refusal = peer.require_compatible(train, Role::Controller);
            let words = refusal.err().map_or_else(String::new, |error| error.to_string());
            (DaemonState::Incompatible, words)
        }
    })
}

/// The host that a root names; NULL takes it from the environment.
///
/// # Safety
///
/// See [the module](super#safety).
pub(super) unsafe fn host_of(root: *const c_char) -> Result<Host, ChannelError> {
    if root.is_null() {
        return Host::from_environment();
    }
    // SAFETY: not NULL, hence a text that ends with a NUL.
    let root = unsafe { CStr::from_ptr(root) };
    Host::at(Path::new(OsStr::from_bytes(root.to_bytes())))
}

/// Who serves a train now: `state` gets a [`DaemonState`], `message` the state in words.
///
/// Opens files: not for the control cycle.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_daemon_state(
    root: *const c_char,
    train_id: u64,
    state: *mut i32,
    message: *mut c_char,
    message_size: usize,
) -> i32 {
    // SAFETY: promised by the caller.
    let message = unsafe { Message::new(message, message_size) };
    guard_in_words(message, || {
        // SAFETY: promised by the caller.
        let place = unsafe { state.as_mut() }.ok_or(Failure::Interface(Code::NullArgument))?;
        // SAFETY: promised by the caller.
        let host = unsafe { host_of(root)? };
        let (state, words) = state_of_daemon(&host, TrainId(train_id))?;
        *place = state as i32;
        message.write(&words);
        Ok(())
    })
}

/// Nanoseconds of the host's monotonic clock.
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub extern "C" fn dynocar_monotonic_now_ns() -> i64 {
    crate::clock::monotonic_now_ns()
}

/// The library's release, for instance `0.1.0`. Never NULL, never to be freed.
#[unsafe(no_mangle)]
pub extern "C" fn dynocar_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => panic!("a release holds no NUL"),
        };
    VERSION.as_ptr()
}

/// Schema major of the library's channels.
#[unsafe(no_mangle)]
pub extern "C" fn dynocar_schema() -> u32 {
    SCHEMA_MAJOR
}

/// Layout hash of the library's sample.
#[unsafe(no_mangle)]
pub extern "C" fn dynocar_sample_layout() -> u64 {
    TrainSample::LAYOUT_HASH
}

/// Layout hash of the library's snapshot.
#[unsafe(no_mangle)]
pub extern "C" fn dynocar_snapshot_layout() -> u64 {
    ParameterSnapshot::LAYOUT_HASH
}
