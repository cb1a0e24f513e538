//! The process that owns an end: a child made by `fork()` has a copy of its parent's memory, not its ends.
//!
//! A page that the kernel wipes in a child marks the process, so that an end can recognise the process without a system
//! call. In a child an end is neither used nor dropped: dropping it would remove the parent's end. A child closes the
//! files whose locks stand for a living process, or it would keep them locked.

use std::fs::File;
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::os::fd::AsRawFd;
use std::sync::Once;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed};
use std::sync::atomic::{AtomicI32, AtomicPtr, AtomicU64};

use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap_anonymous};

use crate::host::monotonic_now_ns;

const PAGE_BYTES: usize = 4096;

/// The mark before any process has made one.
static NONE: AtomicU64 = AtomicU64::new(0);
/// Address of the word that marks this process; the word is zero in a child that has opened nothing.
static MARK: AtomicPtr<AtomicU64> = AtomicPtr::new((&raw const NONE).cast_mut());
static MARK_IS_MADE: Once = Once::new();

fn mark() -> &'static AtomicU64 {
    // SAFETY: points to a static word or to one that stays mapped, and is only written as an atomic.
    unsafe { &*MARK.load(Relaxed) }
}

/// Locked files that a child closes; -1 for a free place. A file that finds no place stays locked until the child has
/// ended, too.
static LOCKED: [AtomicI32; 1024] = [const { AtomicI32::new(-1) }; 1024];

fn make_mark() {
    let (access, flags) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::PRIVATE);
    // SAFETY: a new mapping at a place of the system's choice.
    let place = unsafe { mmap_anonymous(std::ptr::null_mut(), PAGE_BYTES, access, flags) };
    let page = place.map(|place| {
        // A kernel without the advice leaves the mark to the handler below.
        // SAFETY: the mapping is ours, and nobody else knows of it.
        let _ = unsafe { madvise(place, PAGE_BYTES, Advice::LinuxWipeOnFork) };
        place.cast::<AtomicU64>()
    });
    // SAFETY: the handler makes only calls that are allowed after a fork.
    unsafe { libc::pthread_atfork(None, None, Some(forget_parent)) };
    // Without a page of its own a word of the library's does, by the handler alone.
    static PLAIN: AtomicU64 = AtomicU64::new(0);
    MARK.store(page.unwrap_or((&raw const PLAIN).cast_mut()), Relaxed);
}

/// In the child of a `fork()`.
extern "C" fn forget_parent() {
    mark().store(0, Relaxed);
    for place in &LOCKED {
        let file = place.swap(-1, Relaxed);
        if file >= 0 {
            // SAFETY: the parent's file, which nobody in this process uses or closes any more.
            unsafe { libc::close(file) };
        }
    }
}

/// Returns this process's mark, made when it opens its first end; times make marks that no other process has.
fn mark_of_this_process() -> u64 {
    MARK_IS_MADE.call_once(make_mark);
    let fresh = monotonic_now_ns().unsigned_abs() | 1;
    match mark().compare_exchange(0, fresh, AcqRel, Acquire) {
        Ok(_) => fresh,
        Err(present) => present,
    }
}

/// The process that opened something.
#[derive(Clone, Copy, Debug)]
pub struct Owner(u64);

impl Owner {
    /// Returns this process.
    pub fn current() -> Self {
        Owner(mark_of_this_process())
    }

    /// False in a child that was forked since.
    ///
    /// # Real-time
    ///
    /// Two loads.
    #[inline]
    pub fn is_this_process(self) -> bool {
        mark().load(Relaxed) == self.0
    }
}

/// Something that only the process that made it drops.
#[derive(Debug)]
pub(crate) struct Owned<T> {
    value: ManuallyDrop<T>,
    owner: Owner,
}

impl<T> Owned<T> {
    pub(crate) fn new(value: T) -> Self {
        Owned { value: ManuallyDrop::new(value), owner: Owner::current() }
    }

    /// Returns the value, unless this is a child that was forked since it was made.
    #[inline]
    pub(crate) fn own(&self) -> Option<&T> {
        self.owner.is_this_process().then_some(&self.value)
    }
}

impl<T> Deref for Owned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> Drop for Owned<T> {
    fn drop(&mut self) {
        if self.owner.is_this_process() {
            // SAFETY: dropped here alone.
            unsafe { ManuallyDrop::drop(&mut self.value) };
        }
    }
}

fn replace_locked(old: i32, new: i32) {
    let _ = LOCKED.iter().any(|it| it.compare_exchange(old, new, AcqRel, Relaxed).is_ok());
}

/// A file whose lock stands for this process, and for no child of it.
#[derive(Debug)]
pub(crate) struct LockedFile(Owned<File>);

impl LockedFile {
    pub(crate) fn new(file: File) -> Self {
        let file = Owned::new(file);
        replace_locked(-1, file.as_raw_fd());
        LockedFile(file)
    }

    /// Returns the file, unless this is a child.
    pub(crate) fn own(&self) -> Option<&File> {
        self.0.own()
    }
}

impl Deref for LockedFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl Drop for LockedFile {
    fn drop(&mut self) {
        if let Some(file) = self.0.own() {
            replace_locked(file.as_raw_fd(), -1);
        }
    }
}
