//! The end from which a C controller polls snapshots.

use std::ffi::c_char;

use dynocar_shared::services::PIPELINES_MAX;
use dynocar_shared::{
    ParameterSnapshot, PipelineKind, Quantity, Reason, Status, TrainId, UseState, wire_struct,
};

use super::about::{dynocar_reason_name, dynocar_use_state_name, host_of};
use super::error::{Code, Message, guard, guard_in_words};
use super::handle::Handle;
use crate::reader::{Reading, SnapshotReader};

/// `dynocar_reader` in C.
pub type ReaderHandle = Handle<SnapshotReader>;

wire_struct! {
    /// A snapshot copied out for the caller, with its age; `dynocar_reading` in C.
    pub struct ReadingCopy {
        /// Time in ns since the daemon last vouched for the snapshot.
        pub age_ns: i64,
        /// [`Status`] by number; invalid while the daemon is silent.
        pub status: u32,
        /// [`Reason`] by number; a number of a newer peer passes as it came.
        pub reason: u32,
        /// 1 when the daemon has been silent for too long, else 0.
        pub is_stale: u32,
        /// 1 when a controller may use the values, else 0.
        pub is_usable: u32,
        /// The snapshot as the daemon wrote it.
        pub snapshot: ParameterSnapshot,
    }
}

impl ReadingCopy {
    /// Returns the snapshot of a caller who was given none: nothing in it may be used.
    pub const fn none() -> Self {
        ReadingCopy {
            age_ns: i64::MAX,
            status: Status::Invalid as u32,
            reason: Reason::DaemonSilent as u32,
            is_stale: 1,
            is_usable: 0,
            snapshot: ParameterSnapshot::empty(),
        }
    }
}

impl From<Reading<'_>> for ReadingCopy {
    fn from(reading: Reading<'_>) -> Self {
        ReadingCopy {
            age_ns: reading.age_ns,
            status: reading.status() as u32,
            reason: reading.reason().map_or(reading.snapshot.reason, |reason| reason as u32),
            is_stale: u32::from(reading.is_stale),
            is_usable: u32::from(reading.is_usable()),
            snapshot: *reading.snapshot,
        }
    }
}

impl ReadingCopy {
    /// Returns the state of use of the request; a status of a newer peer reads as invalid.
    pub fn use_state(&self) -> UseState {
        let status = Status::from_number(self.status).unwrap_or(Status::Invalid);
        UseState::of(status, self.is_usable != 0)
    }

    /// Returns the reason for that state, see [`Reading::why`].
    pub fn why(&self) -> &'static str {
        self.use_state().why(Reason::from_number(self.reason))
    }
}

/// The state of use of a reading, a [`UseState`] by number; NULL is unavailable.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reading_use_state(reading: *const ReadingCopy) -> u32 {
    // SAFETY: promised by the caller.
    unsafe { reading.as_ref() }.map_or(UseState::Unavailable, ReadingCopy::use_state) as u32
}

/// Returns the reason for the state of use, see [`Reading::why`]. Never NULL, never to be freed.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reading_why(reading: *const ReadingCopy) -> *const c_char {
    // SAFETY: promised by the caller.
    let Some(reading) = (unsafe { reading.as_ref() }) else {
        return dynocar_reason_name(Reason::DaemonSilent as u32);
    };
    let state = reading.use_state();
    if reading.why() == state.name() {
        dynocar_use_state_name(state as u32)
    } else {
        dynocar_reason_name(reading.reason)
    }
}

/// Opens the snapshot channel of a train; see [`SnapshotReader::open`].
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_open(
    root: *const c_char,
    train_id: u64,
    reader: *mut *mut ReaderHandle,
    message: *mut c_char,
    message_size: usize,
) -> i32 {
    // SAFETY: promised by the caller.
    let message = unsafe { Message::new(message, message_size) };
    guard_in_words(message, || {
        // SAFETY: promised by the caller.
        unsafe { Handle::open(reader, || SnapshotReader::open(&host_of(root)?, TrainId(train_id))) }
    })
}

/// Sets the age in ns from which a snapshot counts as stale.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_set_stale_after_ns(
    reader: *mut ReaderHandle,
    stale_after_ns: i64,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller.
        let reader = unsafe { Handle::end(reader)? };
        if stale_after_ns <= 0 {
            return Err(Code::BadNumber);
        }
        reader.set_stale_after_ns(stale_after_ns);
        Ok(())
    })
}

/// Takes the messages since the last poll; `news` (may be NULL) gets the number of snapshots that brought something
/// new.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle, see [`SnapshotReader::poll`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_poll(reader: *mut ReaderHandle, news: *mut u32) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller.
        let count = unsafe { Handle::end(reader)? }.poll();
        // SAFETY: promised by the caller.
        if let Some(news) = unsafe { news.as_mut() } {
            *news = count as u32;
        }
        Ok(())
    })
}

/// Copies the newest snapshot of the pipeline that answers a quantity; after a failure the reading
/// holds nothing that may be used.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle, see [`SnapshotReader::quantity`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_quantity(
    reader: *mut ReaderHandle,
    quantity: u32,
    now_ns: i64,
    reading: *mut ReadingCopy,
) -> i32 {
    // SAFETY: promised by the caller.
    unsafe {
        copy_reading(reader, reading, |reader| {
            let quantity = Quantity::from_number(quantity).ok_or(Code::BadNumber)?;
            Ok(reader.quantity(quantity, now_ns)?)
        })
    }
}

/// Copies the newest snapshot of the first pipeline of a kind; after a failure the reading holds
/// nothing that may be used.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_latest(
    reader: *mut ReaderHandle,
    pipeline_kind: u32,
    now_ns: i64,
    reading: *mut ReadingCopy,
) -> i32 {
    // SAFETY: promised by the caller.
    unsafe {
        copy_reading(reader, reading, |reader| {
            let kind = PipelineKind::from_number(pipeline_kind).ok_or(Code::BadNumber)?;
            reader.latest(kind, now_ns).ok_or(Code::NoSnapshot)
        })
    }
}

/// Copies the newest snapshot of the pipeline with this number in the daemon's configuration.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_latest_by_index(
    reader: *mut ReaderHandle,
    pipeline_index: u32,
    now_ns: i64,
    reading: *mut ReadingCopy,
) -> i32 {
    // SAFETY: promised by the caller.
    unsafe {
        copy_reading(reader, reading, |reader| {
            if pipeline_index as usize >= PIPELINES_MAX {
                return Err(Code::BadNumber);
            }
            let is_wanted =
                |reading: &Reading<'_>| reading.snapshot.pipeline_index == pipeline_index;
            reader.readings(now_ns).find(is_wanted).ok_or(Code::NoSnapshot)
        })
    }
}

/// Counts messages that no daemon of ours would send: foreign train, number out of range, NaN.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_refused(reader: *mut ReaderHandle, count: *mut u64) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller.
        let reader = unsafe { Handle::end(reader)? };
        // SAFETY: promised by the caller.
        *unsafe { count.as_mut() }.ok_or(Code::NullArgument)? = reader.refused();
        Ok(())
    })
}

/// Closes a reader; NULL does nothing.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_reader_close(reader: *mut ReaderHandle) -> i32 {
    // SAFETY: promised by the caller.
    guard(|| unsafe { Handle::close(reader) })
}

/// # Safety
///
/// See [the module](super#safety).
unsafe fn copy_reading(
    reader: *mut ReaderHandle,
    place: *mut ReadingCopy,
    pick: impl for<'a> FnOnce(&'a SnapshotReader) -> Result<Reading<'a>, Code>,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller; every bit pattern is a reading.
        let place = unsafe { place.as_mut() }.ok_or(Code::NullArgument)?;
        *place = ReadingCopy::none();
        // SAFETY: promised by the caller.
        let reader = unsafe { Handle::end(reader)? };
        *place = pick(reader)?.into();
        Ok(())
    })
}
