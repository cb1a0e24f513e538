//! The end into which a C controller writes samples.

use std::ffi::c_char;
use std::time::Duration;

use dynocar_shared::{TrainId, TrainSample};

use super::about::host_of;
use super::error::{Code, Message, guard, guard_in_words};
use super::handle::Handle;
use crate::publisher::SamplePublisher;

/// `dynocar_publisher` in C.
pub type PublisherHandle = Handle<SamplePublisher>;

/// Opens the sample channel of a train; see [`SamplePublisher::open`].
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_publisher_open(
    root: *const c_char,
    train_id: u64,
    publisher: *mut *mut PublisherHandle,
    message: *mut c_char,
    message_size: usize,
) -> i32 {
    // SAFETY: promised by the caller.
    let message = unsafe { Message::new(message, message_size) };
    guard_in_words(message, || {
        // SAFETY: promised by the caller.
        unsafe {
            Handle::open(publisher, || SamplePublisher::open(&host_of(root)?, TrainId(train_id)))
        }
    })
}

/// Starts a new run (trip): filters do not integrate across.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_publisher_start_run(publisher: *mut PublisherHandle) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller.
        unsafe { Handle::end(publisher)? }.start_run();
        Ok(())
    })
}

/// Publishes a sample and fills in its train, sequence number, run and time of publishing.
///
/// # Safety
///
/// See [the module](super#safety).
///
/// # Real-time
///
/// Safe for the control cycle, see [`SamplePublisher::publish`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_publisher_publish(
    publisher: *mut PublisherHandle,
    sample: *mut TrainSample,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller.
        let publisher = unsafe { Handle::end(publisher)? };
        // SAFETY: promised by the caller; every bit pattern is a sample.
        let sample = unsafe { sample.as_mut() }.ok_or(Code::NullArgument)?;
        publisher.publish(sample)?;
        Ok(())
    })
}

/// Waits until every pipeline has taken every sample; see [`SamplePublisher::flush`].
///
/// # Safety
///
/// See [the module](super#safety); `not_taken` is NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_publisher_flush(
    publisher: *mut PublisherHandle,
    patience_ns: i64,
    not_taken: *mut u64,
) -> i32 {
    guard(|| {
        // SAFETY: promised by the caller.
        let publisher = unsafe { Handle::end(publisher)? };
        let left = publisher.flush(Duration::from_nanos(patience_ns.max(0) as u64));
        // SAFETY: promised by the caller.
        if let Some(place) = unsafe { not_taken.as_mut() } {
            *place = left;
        }
        Ok(())
    })
}

/// Closes a publisher and gives the train free, after a wait of at most
/// [`CLOSE_PATIENCE`](crate::publisher::CLOSE_PATIENCE); NULL does nothing.
///
/// # Safety
///
/// See [the module](super#safety).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dynocar_publisher_close(publisher: *mut PublisherHandle) -> i32 {
    // SAFETY: promised by the caller.
    guard(|| unsafe { Handle::close(publisher) })
}
