//! Target of a `dynocar_publisher *` or a `dynocar_reader *`.
//!
//! The transport's ports belong to the thread that opened them. Rust enforces that at compile time; here every call
//! compares the thread, and the process where one has forked, so that a mistake is a code instead of a data race.

use super::error::{Code, Failure};
use dynocar_transport::ChannelError;
use dynocar_transport::channel::Owner;

/// One end of a channel, with the thread it belongs to.
#[derive(Debug)]
pub struct Handle<T> {
    process: Owner,
    owner: ThreadMark,
    end: T,
}

/// Distinguishes living threads without a system call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ThreadMark(usize);

impl ThreadMark {
    fn of_this_thread() -> Self {
        thread_local! {
            static MARK: u8 = const { 0 };
        }
        // Each living thread has the byte at an address of its own.
        ThreadMark(MARK.with(|mark| std::ptr::from_ref(mark) as usize))
    }
}

impl<T> Handle<T> {
    /// Makes an end and hands it to the caller; `place` holds NULL after a failure.
    ///
    /// # Safety
    ///
    /// `place` is NULL or writable.
    pub(super) unsafe fn open(
        place: *mut *mut Self,
        make: impl FnOnce() -> Result<T, ChannelError>,
    ) -> Result<(), Failure> {
        if place.is_null() {
            return Err(Failure::Interface(Code::NullArgument));
        }
        // SAFETY: not NULL, hence writable.
        unsafe { place.write(std::ptr::null_mut()) };
        let end = make()?;
        let handle = Handle { process: Owner::current(), owner: ThreadMark::of_this_thread(), end };
        // SAFETY: as above.
        unsafe { place.write(Box::into_raw(Box::new(handle))) };
        Ok(())
    }

    /// The end behind a handle.
    ///
    /// # Safety
    ///
    /// `handle` is NULL or comes from [`Handle::open`] and is not closed; the thread holds no
    /// other reference into it.
    pub(super) unsafe fn end<'a>(handle: *mut Self) -> Result<&'a mut T, Code> {
        // SAFETY: as promised by the caller.
        unsafe { Self::require_owner(handle)? };
        // SAFETY: the handle is alive and this thread is the only one that reaches its end.
        Ok(unsafe { &mut (*handle).end })
    }

    /// Closes a handle; NULL is closed already.
    ///
    /// # Safety
    ///
    /// See [`Handle::end`].
    pub(super) unsafe fn close(handle: *mut Self) -> Result<(), Code> {
        if handle.is_null() {
            return Ok(());
        }
        // SAFETY: as promised by the caller.
        unsafe { Self::require_owner(handle)? };
        // SAFETY: the pointer came from a box, and the caller gives it up.
        drop(unsafe { Box::from_raw(handle) });
        Ok(())
    }

    /// # Safety
    ///
    /// See [`Handle::end`].
    unsafe fn require_owner(handle: *mut Self) -> Result<(), Code> {
        if handle.is_null() {
            return Err(Code::NullArgument);
        }
        // SAFETY: the handle is alive; its owners never change, so that any thread may read them.
        let process = unsafe { (&raw const (*handle).process).read() };
        if !process.is_this_process() {
            return Err(Code::ForkedProcess);
        }
        // SAFETY: as above.
        let owner = unsafe { (&raw const (*handle).owner).read() };
        if owner == ThreadMark::of_this_thread() { Ok(()) } else { Err(Code::WrongThread) }
    }
}
