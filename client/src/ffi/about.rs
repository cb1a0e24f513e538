//! Clock, versions, who serves a train, and the vocabularies' names.

use std::ffi::{CStr, OsStr, c_char};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{
    Manoeuvre, MassSource, Parameter, ParameterSnapshot, PipelineKind, Quantity, Reason,
    RejectionReason, SCHEMA_MAJOR, Status, TrainId, TrainSample, UseState, vocabulary,
};

use super::error::{Code, Failure, Message, guard_in_words};
use dynocar_transport::{ChannelError, Host, Peer, Role};

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
    dynocar_transport::monotonic_now_ns()
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

/// Room for the longest name and its NUL.
const NAME_BYTES: usize = 40;
const UNKNOWN: &CStr = c"(a number of another release)";

/// A name followed by NULs.
const fn padded(name: &str) -> [u8; NAME_BYTES] {
    assert!(name.len() < NAME_BYTES);
    let mut bytes = [0; NAME_BYTES];
    let mut i = 0;
    while i < name.len() {
        bytes[i] = name.as_bytes()[i];
        i += 1;
    }
    bytes
}

/// Exports the names of one vocabulary.
macro_rules! export_names {
    ($( $(#[$meta:meta])* $function:ident: $vocabulary:ident by $number:expr ),* $(,)?) => { $(
        $(#[$meta])*
        /// Never NULL, never to be freed.
        ///
        /// # Real-time
        ///
        /// Safe for the control cycle.
        #[unsafe(no_mangle)]
        pub extern "C" fn $function(number: u32) -> *const c_char {
            const COUNT: usize = $vocabulary::ALL.len();
            static NAMES: [[u8; NAME_BYTES]; COUNT] = {
                let mut names = [[0; NAME_BYTES]; COUNT];
                let mut i = 0;
                while i < COUNT {
                    names[i] = padded($vocabulary::ALL[i].name());
                    i += 1;
                }
                names
            };
            let number_of: fn($vocabulary) -> u32 = $number;
            let index = $vocabulary::ALL.iter().position(|member| number_of(*member) == number);
            index.map_or(UNKNOWN.as_ptr(), |index| NAMES[index].as_ptr().cast())
        }
    )* };
}

export_names! {
    /// The name of a [`PipelineKind`].
    dynocar_pipeline_name: PipelineKind by |it| it as u32,
    /// The name of a [`Quantity`].
    dynocar_quantity_name: Quantity by |it| it as u32,
    /// The name of a [`MassSource`].
    dynocar_mass_source_name: MassSource by |it| it as u32,
    /// The name of a [`Parameter`].
    dynocar_parameter_name: Parameter by |it| it as u32,
    /// The name of a [`Status`].
    dynocar_status_name: Status by |it| it as u32,
    /// The name of a [`UseState`].
    dynocar_use_state_name: UseState by |it| it as u32,
    /// The name of a [`Reason`].
    dynocar_reason_name: Reason by |it| it as u32,
    /// The name of a [`RejectionReason`].
    dynocar_rejection_name: RejectionReason by |it| it as u32,
    /// The name of a [`Manoeuvre`], by its bit.
    dynocar_manoeuvre_name: Manoeuvre by Manoeuvre::bit,
    /// The name of an [`EffectKind`].
    dynocar_effect_name: EffectKind by |it| it as u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(name: *const c_char) -> &'static str {
        // SAFETY: the names are static and end with a NUL.
        unsafe { CStr::from_ptr(name) }.to_str().unwrap()
    }

    #[test]
    fn every_member_has_its_name_and_other_numbers_say_so() {
        for &kind in PipelineKind::ALL {
            assert_eq!(text(dynocar_pipeline_name(kind as u32)), kind.name());
        }
        for &effect in EffectKind::ALL {
            assert_eq!(text(dynocar_effect_name(effect as u32)), effect.name());
        }
        assert_eq!(text(dynocar_status_name(99)), "(a number of another release)");
    }
}
